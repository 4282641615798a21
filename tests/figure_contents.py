"""What figures show: pixels, and the polygons of SVG files."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree

import numpy as np

from coneflat.apps.view import new_figure

SVG = "{http://www.w3.org/2000/svg}"
RED, BLACK = (214, 34, 34), (0, 0, 0)


def axes_of(size=4.0, dpi=100.0):
    """Return axes that fill a figure."""
    figure = new_figure(size, size, dpi=dpi)
    return figure.add_axes((0.0, 0.0, 1.0, 1.0))


def pixels(figure):
    """Return what a figure shows, (h, w, 3) integers, row 0 at the top."""
    figure.canvas.draw()
    return np.asarray(figure.canvas.buffer_rgba())[..., :3].astype(int)


def shown_at(axes, points):
    """Return the colours (k, 3) that a figure shows at places in the axes' coordinates."""
    image = pixels(axes.figure)
    x, y = axes.transData.transform(points).T
    return image[(len(image) - y).astype(int), x.astype(int)]


def groups(path):
    """Return the groups of an SVG file by name."""
    return {group.get("id"): group for group in ElementTree.parse(path).iter(f"{SVG}g")}


def polygons(group):
    """Return the closed curves (k, 2) of the paths of a group, in points of the file."""
    curves = []
    for path in group.iter(f"{SVG}path"):
        for part in path.get("d").split("M")[1:]:
            if "z" in part:
                numbers = re.findall(r"-?[\d.]+(?:e-?\d+)?", part)
                curves.append(np.array(numbers, dtype=float).reshape(-1, 2))
    return curves


def count_dots(group):
    """Return how many markers a group has."""
    if group is None:
        return 0
    drawn = [
        element
        for part in group.iter(f"{SVG}g")
        for element in part
        if element.tag in (f"{SVG}path", f"{SVG}use")
    ]
    return len(drawn)


def enclosed(curve):
    """Return the signed area inside a closed curve."""
    x, y = curve.T
    return (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2
