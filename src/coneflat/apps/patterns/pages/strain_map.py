"""A picture of the pieces coloured by strain, with a legend."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ....base import FloatArray
from ....geometry import double_areas, edge_lengths, fill_nearest
from ..drawing.drawing import Drawing, Text
from ..pieces.cut_surface import CutSurface
from ..result import Pattern
from ..units import percentage
from .pages import Picture

# Strain from which there is a map: the pieces are exact below.
MIN_STRAIN = 1e-4
# Samples per pixel along each axis, and pixels per millimetre: 150 per inch.
SAMPLES, PIXELS = 2, 150 / 25.4
# Colours from 0 to 1 of sides that become shorter, keep their length, and become longer; lines around pieces.
SHORTER, EQUAL, LONGER, BORDER = (0.13, 0.4, 0.67), (0.94, 0.94, 0.94), (0.7, 0.09, 0.17), 0.25
# Share of the area in which colours do not end: a few needles would make all others pale.
SHOWN_SHARE = 0.98
# Heights of the bar of the legend, and of capitals, mm; distance of lines of text.
BAR, SIZE, LEADING = 3.0, 2.1, 4.0


def side_strains(surface: CutSurface) -> FloatArray:
    """Return (m,) the relative change of length of the side of each triangle that changes most."""
    flat = edge_lengths(np.pad(surface.points, ((0, 0), (0, 1))), surface.corners)
    strains = flat / edge_lengths(surface.mesh.vertices, surface.mesh.faces) - 1
    largest = np.abs(strains).argmax(axis=1)[:, None]
    return np.take_along_axis(strains, largest, axis=1)[:, 0]


def is_strained(pattern: Pattern) -> bool:
    """Return whether a pattern has a map of its strain."""
    return bool(np.abs(pattern.strains).max() > MIN_STRAIN)


def strain_map(pattern: Pattern, low: FloatArray, size: FloatArray) -> tuple[list[Picture], Drawing]:
    """Return the pieces in the plane coloured by strain, and a legend below them.

    Args:
        pattern: the pattern.
        low: (2,) the lower left corner of the place for it, mm.
        size: (2,) the width and height of the place, mm.
    """
    surface = pattern.surface
    strains = side_strains(surface)
    end = _end_of_colours(surface, np.abs(strains))
    width, height = float(size[0]), float(size[1])
    legend = BAR + 4 * LEADING
    picture = Picture(
        _pixels(surface, strains / end, width, height - legend),
        low + np.array([0.0, legend]),
        width,
        height - legend,
    )
    bar_low = low + np.array([0.0, legend - BAR - LEADING / 2])
    ramp = np.round(255 * colours(np.linspace(-1, 1, 255))[None]).astype(np.uint8)
    bar = Picture(ramp, bar_low, width, BAR)
    edges = np.abs(pattern.strains)
    mean = float(np.average(edges, weights=surface.edges.lengths))
    texts = [
        *_ends_of_legend(end, bar_low, width),
        _line("Strain of the pieces:", low, 1),
        _line(f"largest {percentage(float(edges.max()))}, mean {percentage(mean)}", low, 0),
    ]
    return [picture, bar], Drawing(0.0, 0.0, (), tuple(texts))


def _line(text: str, low: FloatArray, row: int) -> Text:
    return Text(text, low + np.array([0.0, row * LEADING + SIZE / 2]), SIZE, is_left=True)


def _ends_of_legend(end: float, low: FloatArray, width: float) -> list[Text]:
    """Return the texts below the bar: its ends and its middle."""
    y = -LEADING / 2
    quarter = width / 5
    return [
        Text(f"-{percentage(end)}", low + np.array([quarter / 2, y]), SIZE),
        Text("0", low + np.array([width / 2, y]), SIZE),
        Text(f"+{percentage(end)}", low + np.array([width - quarter / 2, y]), SIZE),
    ]


def _end_of_colours(surface: CutSurface, strains: FloatArray) -> float:
    """Return the strain at the ends of the colours: that of a share of the area is below."""
    areas = double_areas(edge_lengths(surface.mesh.vertices, surface.mesh.faces))
    order = np.argsort(strains)
    shares = np.cumsum(areas[order]) / areas.sum()
    return float(strains[order[min(int(np.searchsorted(shares, SHOWN_SHARE)), len(order) - 1)]])


def colours(values: FloatArray) -> FloatArray:
    """Return (k, 3) the colours of values (k,) from -1 to 1, those of the ends beyond."""
    nodes = np.array([SHORTER, EQUAL, LONGER])
    return np.stack([np.interp(values, [-1.0, 0.0, 1.0], channel) for channel in nodes.T], axis=1)


def _pixels(surface: CutSurface, values: FloatArray, width: float, height: float) -> NDArray[np.uint8]:
    """Return (h, w, 3) the colours of a picture of the pieces with a size in mm."""
    columns, rows = round(PIXELS * width), round(PIXELS * height)
    low, extent = surface.points.min(axis=0), np.ptp(surface.points, axis=0)
    pixels = SAMPLES * np.array([columns, rows])
    scale = float((0.98 * pixels / extent).min())
    x, y = (pixels / 2 + (surface.points - low - extent / 2) * scale).T
    points = np.ascontiguousarray(np.stack([x, pixels[1] - y, np.zeros(len(x))], axis=1))
    depth, face = np.full((pixels[1], pixels[0]), np.inf), np.full((pixels[1], pixels[0]), -1, dtype=np.int64)
    fill_nearest(points, np.ascontiguousarray(surface.corners, np.int64), depth, face)
    image = colours(values)[face]
    image[face < 0] = 1.0
    image[_is_rim(face >= 0)] = BORDER
    return np.round(255 * image.reshape(rows, SAMPLES, columns, SAMPLES, 3).mean(axis=(1, 3))).astype(
        np.uint8
    )


def _is_rim(is_piece: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return (h, w) the pixels of pieces beside the background."""
    padded = np.pad(is_piece, 1)
    inner = padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
    return is_piece & ~inner
