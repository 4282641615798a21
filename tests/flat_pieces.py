"""Patterns made by hand, whose lengths are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapes

from coneflat import Pattern, TriangleMesh, unwrap
from coneflat.apps.patterns.pieces.cut_surface import CutSurface
from coneflat.geometry import signed_double_areas


def sheet(width: float = 120.0, height: float = 80.0, columns: int = 6, rows: int = 4) -> CutSurface:
    """A rectangle in the plane, of one piece."""
    x, y = np.meshgrid(np.linspace(0, width, columns + 1), np.linspace(0, height, rows + 1), indexing="ij")
    index = np.arange(x.size).reshape(x.shape)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate([np.stack([p.ravel() for p in corners], 1) for corners in ((a, b, c), (a, c, d))])
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    return CutSurface(TriangleMesh(np.pad(points, ((0, 0), (0, 1))), faces), faces, points)


def annulus(inner: float = 500.0, outer: float = 560.0, columns: int = 96) -> CutSurface:
    """A ring in the plane, of one piece; its radii in millimetres."""
    angles = 2 * np.pi * np.arange(columns) / columns
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    points = np.concatenate([inner * circle, outer * circle])
    a, b = np.arange(columns), (np.arange(columns) + 1) % columns
    faces = np.concatenate([np.stack([a, a + columns, b + columns], 1), np.stack([a, b + columns, b], 1)])
    return CutSurface(TriangleMesh(np.pad(points, ((0, 0), (0, 1))), faces), faces, points)


def cut_at(surface: CutSurface, x: float, until: float = np.inf) -> CutSurface:
    """A surface that is cut along a vertical line, up to a height."""
    mesh = surface.mesh
    ends = mesh.vertices[mesh.edges]
    is_on = (np.abs(ends[:, :, 0] - x) < 1e-9).all(axis=1) & (ends[:, :, 1] <= until + 1e-9).all(axis=1)
    return surface.cut_along(np.flatnonzero(is_on))


def two_pieces(kind: str = "cloth", shrink: float = 1.0, **settings) -> Pattern:
    """Two rectangles of 60 x 80 mm with a seam of 80 mm; the second one may be shrunk in the plane along the seam."""
    surface = cut_at(sheet(), 60.0)
    points = surface.points.copy()
    second = np.unique(surface.corners[surface.pieces == 1])
    points[second] = points[second] * [1.0, shrink] + [50.0, 0.0]
    return Pattern(kind, replace(surface, points=points), 1.0, settings=settings)


def with_dart(**settings) -> Pattern:
    """A rectangle with a slit that opens downward, 40 mm long."""
    surface = cut_at(sheet(), 60.0, 40.0)
    points = surface.points.copy()
    x, y = points.T
    opening = np.maximum(40.0 - y, 0.0) / 4
    side = np.zeros(len(points))
    centres = surface.places.mean(axis=1)[:, 0]
    side[surface.corners] = np.sign(centres - 60.0)[:, None]
    points[:, 0] = x + side * opening
    return Pattern("cloth", replace(surface, points=points), 1.0, settings=settings)


def gores(count: int = 8, rows: int = 12, radius: float = 40.0, kind: str = "gores", **settings) -> Pattern:
    """Strips of a globe from pole to pole, two quads wide."""
    latitude, places, points = np.linspace(-np.pi / 2, np.pi / 2, rows + 1), {}, {}
    vertices, flat, faces, corners = [], [], [], []

    def vertex(row, column):
        at_pole = row in (0, rows)
        key = row, 0 if at_pole else column % (2 * count)
        if key not in places:
            angle, ring = np.pi * key[1] / count, 0.0 if at_pole else np.cos(latitude[row])
            places[key] = len(vertices)
            vertices.append([ring * np.sin(angle), np.sin(latitude[row]), ring * np.cos(angle)])
        return places[key]

    def point(gore, row, column):
        key = gore, row, 0 if row in (0, rows) else column
        if key not in points:
            points[key] = len(flat)
            ring = 0.0 if row in (0, rows) else np.cos(latitude[row])
            flat.append([(column - 1) * np.pi / count * ring + gore, latitude[row]])
        return points[key]

    for gore in range(count):
        for column in (0, 1):
            for row in range(rows):
                quad = (row, column), (row, column + 1), (row + 1, column + 1), (row + 1, column)
                for chosen in ((0, 1, 2), (0, 2, 3)):
                    triangle = [vertex(quad[k][0], 2 * gore + quad[k][1]) for k in chosen]
                    if len(set(triangle)) == 3:
                        faces.append(triangle)
                        corners.append([point(gore, *quad[k]) for k in chosen])
    mesh = TriangleMesh(radius * np.array(vertices), np.array(faces))
    return Pattern(kind, CutSurface(mesh, np.array(corners), radius * np.array(flat)), 1.0, settings=settings)


def assert_lawful(pattern: Pattern) -> None:
    """Assert what holds for every pattern: no flipped or overlapping triangles, and sides of seams equally long."""
    surface = pattern.surface
    assert (signed_double_areas(surface.places) > 0).all()
    assert not len(surface.overlaps())
    lengths = np.array([seam.lengths for seam in pattern.seams]).reshape(-1, 2)
    assert np.abs(lengths[:, 0] - lengths[:, 1]).max(initial=0.0) < 1e-6


def cut_sphere(energy=4.05):
    """A sphere of 320 triangles, cut as a texture is."""
    return CutSurface.of(unwrap(*shapes.sphere(2), max_energy=energy, packing_cuts=0))
