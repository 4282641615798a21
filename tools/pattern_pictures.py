"""The documentation's pictures of patterns: the pages of their PDF files."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from markers import ROOT
from measured import Measured
from PIL import Image, ImageOps

import coneflat
from coneflat.apps.patterns.pages.views import piece_colour, view_of
from coneflat.apps.view import eye_direction
from coneflat.apps.view.figures.cone_marks import pixels_of
from coneflat.geometry import unit_vectors

sys.path.insert(0, str(ROOT / "tests"))
import polyhedra
import shapes

Arrays = tuple[np.ndarray, np.ndarray]

#: The program of poppler that draws the pages of PDF files.
PDF_TO_PNG = "pdftoppm"
#: Width of a page in pixels, that of small ones, and the number of pages from which they are small.
PAGE_WIDTH, SMALL_PAGE_WIDTH, SMALL_FROM = 420, 330, 7
COLUMNS, BORDER, GAP = 4, 1, 6
#: Triangles of the low-poly animal.
LOW_POLY = 150


@dataclass(frozen=True)
class Example:
    """A pattern of which the pages are shown.

    Attributes:
        mesh: returns the model.
        options: of `coneflat.pattern`.
        models: names of stored models that it needs.
    """

    mesh: Callable[[Measured], Arrays]
    options: dict[str, Any] = field(default_factory=dict)
    models: tuple[str, ...] = ()


def spot(measured: Measured) -> Arrays:
    source = coneflat.read_mesh(measured.path("spot"))
    return source.vertices, source.triangles


def low_poly(measured: Measured) -> Arrays:
    """Return an animal of few triangles."""
    mesh = coneflat.check_mesh(*spot(measured)).mesh
    coarse = coneflat.geometry.coarse_mesh(mesh, LOW_POLY).mesh
    return coarse.vertices, coarse.faces


def sphere(_: Measured) -> Arrays:
    mesh = polyhedra.icosphere(4)
    return mesh.vertices, mesh.faces


def cone_shade(_: Measured) -> Arrays:
    """Return a lamp shade: the side of a truncated cone, about z."""
    mesh = polyhedra.turned([0.5, 0.3], [0.0, 0.5], 96)
    return mesh.vertices, mesh.faces


def bell_shade(_: Measured) -> Arrays:
    """Return a curved lamp shade about z."""
    up = np.linspace(0.0, 1.0, 17)
    mesh = polyhedra.turned(0.55 - 0.3 * up + 0.12 * np.sin(np.pi * up), 0.9 * up, 96)
    return mesh.vertices, mesh.faces


#: A bracket: the sizes of its flat parts, the angles of the bends between them (degrees) and their radius, mm; its
#: width; and slots, from and to along and across.
FLATS, BENDS, RADIUS, WIDTH = (60.0, 40.0, 25.0), (90.0, -45.0), 4.0, 50.0
SLOTS = ((15.0, 45.0, 20.0, 30.0), (76.0, 96.0, 15.0, 35.0))
#: Parts of a bend.
BEND_STEPS = 8


def bracket(_: Measured) -> Arrays:
    """Return a bent sheet with slots, in millimetres."""
    along = [0.0]
    for i, length in enumerate(FLATS):
        along.append(along[-1] + length)
        if i < len(BENDS):
            arc = RADIUS * np.radians(abs(BENDS[i]))
            along += (along[-1] + arc * np.arange(1, BEND_STEPS + 1) / BEND_STEPS).tolist()
    across = np.unique([0.0, WIDTH, *(edge for slot in SLOTS for edge in slot[2:])])
    along = np.unique([*np.round(along, 9), *(edge for slot in SLOTS for edge in slot[:2])]).tolist()
    points, faces = shapes.grid(len(along) - 1, len(across) - 1)
    columns, rows = (np.round(points[:, k] / points[:, k].max() * size).astype(int) for k, size in
                     ((0, len(along) - 1), (1, len(across) - 1)))  # fmt: skip
    flat = np.stack([np.array(along)[columns], across[rows]], axis=1)
    middle = flat[faces].mean(axis=1)
    is_slot = np.zeros(len(faces), dtype=bool)
    for start, end, low, high in SLOTS:
        is_slot |= ((middle > [start, low]) & (middle < [end, high])).all(axis=1)
    x, z = _profile(np.array(along))
    vertices = np.stack([x[columns], flat[:, 1], z[columns]], axis=1)
    return shapes.without(vertices, faces, is_slot)


def _profile(along: np.ndarray) -> np.ndarray:
    """Return (2, k) the places of a bent strip at distances along it: bends are cut into chords of their arc."""
    heading = np.zeros(len(along))
    start = 0.0
    for length, bend in zip(FLATS, BENDS, strict=False):
        start += length
        arc = RADIUS * np.radians(abs(bend))
        heading += np.radians(bend) * np.clip((along - start) / arc, 0, 1)
        start += arc
    middle = (heading[1:] + heading[:-1]) / 2
    steps = np.diff(along) * np.stack([np.cos(middle), np.sin(middle)])
    return np.concatenate([np.zeros((2, 1)), np.cumsum(steps, axis=1)], axis=1)


EXAMPLES = {
    "pattern-plush": Example(spot, {"height": "300mm", "strain": "3%", "axis": (0, 1, 0), "page": "A3"}, ("spot",)),
    "pattern-toy": Example(spot, {"height": "150mm", "strain": "6%", "axis": (0, 1, 0)}, ("spot",)),
    "pattern-net": Example(low_poly, {"kind": "net", "height": "160mm", "axis": (0, 1, 0)}, ("spot",)),
    "pattern-gores": Example(sphere, {"kind": "gores", "height": "100mm"}),
    "pattern-ball": Example(sphere, {"height": "100mm", "strain": "3%"}),
    "pattern-shade": Example(cone_shade, {"kind": "sheet", "height": "150mm", "axis": (0, 0, 1), "page": "A3"}),
    "pattern-bell": Example(
        bell_shade, {"kind": "gores", "gores": 8, "height": "200mm", "axis": (0, 0, 1), "page": "A3"}
    ),
    "pattern-bracket": Example(bracket, {"kind": "sheet", "unit": "mm", "axis": (0, 0, 1)}),
}  # fmt: skip


def draw_model_of(pattern: coneflat.Pattern, axes: Any, eye: str, dpi: float) -> None:
    """Draw a model with its pieces in colours."""
    size = pixels_of(axes, dpi)
    view = view_of(
        pattern.surface, size, unit_vectors(eye_direction(eye, "y")[None])[0], np.array([0.0, 1.0, 0.0])
    )
    axes.imshow(view.pixels, extent=(0, size[0], 0, size[1]))
    axes.axis("off")


def draw_pieces(pattern: coneflat.Pattern, axes: Any) -> None:
    """Draw the pieces of a pattern in the colours of `draw_model_of`, with their seam lines."""
    drawing = pattern.drawing()
    for piece, shape in enumerate(pattern.shapes):
        axes.fill(*shape.cut_rings[0].T, facecolor=piece_colour(piece), edgecolor="black", linewidth=0.8)
    for line in drawing.lines:
        if line.dashes:
            axes.plot(*line.points.T, color="#4a4a4a", linewidth=0.6, linestyle=(0, (4, 2)))
    # Lines at the ends of the sheet are not clipped.
    rim = 0.01 * drawing.width
    axes.set_xlim(-rim, drawing.width + rim)
    axes.set_ylim(-rim, drawing.height + rim)
    axes.set_aspect("equal")
    axes.axis("off")


def has_pdf_reader() -> bool:
    """Return whether pages of PDF files can be drawn."""
    return shutil.which(PDF_TO_PNG) is not None


def pages_picture(example: Example, name: str, measured: Measured) -> Image.Image:
    """Return a picture of all pages of a pattern, side by side."""
    result = coneflat.pattern(*example.mesh(measured), **example.options)
    title = name.removeprefix("pattern-")
    with tempfile.TemporaryDirectory() as folder:
        path = result.save(Path(folder) / f"{title}.pdf")
        arguments = [
            PDF_TO_PNG,
            "-png",
            "-scale-to-x",
            "1000",
            "-scale-to-y",
            "-1",
            path,
            Path(folder) / "page",
        ]
        subprocess.run(arguments, check=True)
        return side_by_side([Image.open(page).convert("RGB") for page in sorted(Path(folder).glob("*.png"))])


def side_by_side(pages: list[Image.Image]) -> Image.Image:
    """Return pages in rows, each with a grey border."""
    width = PAGE_WIDTH if len(pages) < SMALL_FROM else SMALL_PAGE_WIDTH
    small = [
        ImageOps.expand(
            page.resize((width, round(width * page.height / page.width)), Image.Resampling.LANCZOS),
            BORDER,
            "#9a9a9a",
        )
        for page in pages
    ]
    columns = min(COLUMNS, len(small))
    rows = [small[i : i + columns] for i in range(0, len(small), columns)]
    heights = [max(page.height for page in row) + GAP for row in rows]
    picture = Image.new("RGB", (columns * (width + 2 * BORDER + GAP) - GAP, sum(heights) - GAP), "white")
    for i, row in enumerate(rows):
        for k, page in enumerate(row):
            picture.paste(page, (k * (width + 2 * BORDER + GAP), sum(heights[:i])))
    return picture
