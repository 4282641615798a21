"""PDF: drawings as pages at their true size."""

from __future__ import annotations

from collections.abc import Iterable
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from ....io import atomic_write, imported
from ..drawing.drawing import LAYERS, Drawing, Line, Text
from ..pages.pages import Page, Picture
from .pens import CAPITALS, PENS

#: Points per millimetre.
POINTS = 72 / 25.4
FONT = "Helvetica"


def write_pdf(pages: Iterable[Page], path: Path, title: str) -> None:
    """Write pages.

    Raises:
        OptionError: reportlab is not installed.
        MeshFileError: the file cannot be written.
    """
    content = pdf_of(pages, title)
    with atomic_write(path) as stream:
        stream.write(content)


def pdf_of(pages: Iterable[Page], title: str) -> bytes:
    """Return pages as the content of a PDF, the same for the same pages: without times and random numbers.

    Raises:
        OptionError: reportlab is not installed.
    """
    canvas_module = imported("reportlab.pdfgen.canvas", "PDF files need reportlab", '"coneflat[patterns]"')
    stream = BytesIO()
    canvas = canvas_module.Canvas(stream, invariant=1, pageCompression=1)
    canvas.setTitle(title)
    canvas.setCreator("coneflat")
    canvas.setViewerPreference("PrintScaling", "None")
    for page in pages:
        canvas.setPageSize((page.drawing.width * POINTS, page.drawing.height * POINTS))
        _draw_page(canvas, page)
        canvas.showPage()
    canvas.save()
    return stream.getvalue()


def _draw_page(canvas: Any, page: Page) -> None:
    canvas.scale(POINTS, POINTS)
    canvas.setLineJoin(1)
    for picture in page.pictures:
        _draw_picture(canvas, picture)
    if page.content is not None and page.window is not None:
        low, high = page.window
        canvas.saveState()
        clip = canvas.beginPath()
        clip.rect(*low.tolist(), *(high - low).tolist())
        canvas.clipPath(clip, stroke=0, fill=0)
        _draw(canvas, page.content)
        canvas.restoreState()
    _draw(canvas, page.drawing)


def _draw_picture(canvas: Any, picture: Picture) -> None:
    from PIL import Image
    from reportlab.lib.utils import ImageReader

    image = ImageReader(Image.fromarray(picture.pixels))
    canvas.drawImage(image, *picture.low.tolist(), picture.width, picture.height)


def _draw(canvas: Any, drawing: Drawing) -> None:
    for layer in LAYERS:
        pen = PENS[layer]
        canvas.setStrokeColorRGB(*pen.rgb)
        canvas.setFillColorRGB(*pen.rgb)
        canvas.setLineWidth(pen.width)
        for line in drawing.lines:
            if line.layer == layer:
                _draw_line(canvas, line)
        for text in drawing.texts:
            if text.layer == layer:
                _draw_text(canvas, text)


def _draw_line(canvas: Any, line: Line) -> None:
    canvas.setDash(list(line.dashes))
    path = canvas.beginPath()
    first, *following = line.points.tolist()
    path.moveTo(*first)
    for point in following:
        path.lineTo(*point)
    if line.is_closed:
        path.close()
    canvas.drawPath(path, stroke=1, fill=0)


def _draw_text(canvas: Any, text: Text) -> None:
    canvas.saveState()
    canvas.translate(*np.asarray(text.place).tolist())
    canvas.rotate(float(np.degrees(text.angle)))
    canvas.setFont(FONT, text.size / CAPITALS)
    draw = canvas.drawString if text.is_left else canvas.drawCentredString
    draw(0, -text.size / 2, text.text)
    canvas.restoreState()
