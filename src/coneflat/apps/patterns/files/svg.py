"""SVG: a drawing on one sheet, in millimetres, a group for each layer."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from ....base import FloatArray
from ....io import atomic_write
from ..drawing.drawing import LAYERS, Drawing, Line, Text
from .pens import CAPITALS, PENS


def write_svg(drawing: Drawing, path: Path) -> None:
    """Write a drawing.

    Raises:
        MeshFileError: the file cannot be written.
    """
    content = ElementTree.tostring(svg_of(drawing), encoding="unicode")
    with atomic_write(path, "w") as stream:
        stream.write(f'<?xml version="1.0" encoding="utf-8"?>\n{content}\n')


def svg_of(drawing: Drawing) -> ElementTree.Element:
    """Return a drawing as the root element of an SVG; a unit is a millimetre."""
    width, height = _number(drawing.width), _number(drawing.height)
    root = ElementTree.Element(
        "svg",
        {
            "xmlns": "http://www.w3.org/2000/svg",
            "width": f"{width}mm",
            "height": f"{height}mm",
            "viewBox": f"0 0 {width} {height}",
        },
    )
    for layer in LAYERS:
        pen = PENS[layer]
        look = {"fill": "none", "stroke": pen.colour, "stroke-width": _number(pen.width)}
        group = ElementTree.SubElement(root, "g", {"id": layer, **look})
        for line in drawing.lines:
            if line.layer == layer:
                _append_line(group, line, drawing.height)
        for text in drawing.texts:
            if text.layer == layer:
                _append_text(group, text, drawing.height)
    ElementTree.indent(root, " ")
    return root


def _append_line(group: ElementTree.Element, line: Line, height: float) -> None:
    kind = "polygon" if line.is_closed else "polyline"
    points = " ".join(f"{_number(x)},{_number(height - y)}" for x, y in line.points.tolist())
    element = ElementTree.SubElement(group, kind, {"points": points})
    if line.dashes:
        element.set("stroke-dasharray", " ".join(map(_number, line.dashes)))


def _append_text(group: ElementTree.Element, text: Text, height: float) -> None:
    x, y = _flipped(text.place, height)
    turn = f" rotate({_number(-text.angle * 57.29577951308232)})" if text.angle else ""
    element = ElementTree.SubElement(
        group,
        "text",
        {
            "transform": f"translate({_number(x)} {_number(y)}){turn}",
            "y": _number(text.size / 2),  # the base line
            "font-family": "Helvetica, Arial, sans-serif",
            "font-size": _number(text.size / CAPITALS),
            "text-anchor": "start" if text.is_left else "middle",
            "fill": PENS[text.layer].colour,
            "stroke": "none",
        },
    )
    element.text = text.text


def _flipped(place: FloatArray, height: float) -> tuple[float, float]:
    return float(place[0]), height - float(place[1])


def _number(value: float) -> str:
    """Return a number with four decimals at most: a ten-thousandth of a millimetre."""
    text = f"{value:.4f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text
