"""A reader of DXF drawings that shares no code with the writer, and what is measured of patterns in them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

#: Codes of groups in a DXF file: the beginning of an entity, its layer, its line type, flags, and coordinates.
ENTITY, LAYER, LINE_TYPE, FLAGS, X, Y = 0, 8, 6, 70, 10, 20
#: Flag of closed polylines.
CLOSED = 1
#: Distance up to which a point of the file is a point of the pattern, mm.
TOLERANCE = 0.005


@dataclass(frozen=True, eq=False)
class DrawnLine:
    """A polyline of a file: its layer, its (k, 2) points, and whether it is closed and dashed."""

    layer: str
    points: np.ndarray
    is_closed: bool
    is_dashed: bool


def dxf_lines(path: Path) -> list[DrawnLine]:
    """Return the polylines of a DXF file."""
    lines = path.read_text(encoding="cp1252").splitlines()
    groups = [(int(code), value.strip()) for code, value in zip(lines[::2], lines[1::2], strict=True)]
    starts = [i for i, (code, _) in enumerate(groups) if code == ENTITY]
    entities = (groups[start:end] for start, end in pairwise([*starts, len(groups)]))
    return [_line(entity) for entity in entities if entity[0][1] == "LWPOLYLINE"]


def _line(entity: list[tuple[int, str]]) -> DrawnLine:
    values = dict(entity)
    points = [[float(value) for code, value in entity if code == axis] for axis in (X, Y)]
    is_closed = bool(int(values.get(FLAGS, "0")) & CLOSED)
    return DrawnLine(values[LAYER], np.array(points).T, is_closed, LINE_TYPE in values)


def seam_lines(lines: Sequence[DrawnLine]) -> Iterator[DrawnLine]:
    """Yield outlines, folds, and seam lines inside allowances."""
    return (line for line in lines if line.layer in ("cut", "fold") or line.is_dashed)


def points_of_file(
    points: np.ndarray, lines: Sequence[DrawnLine], is_border: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the points of a pattern (u, 2), those on seams and folds as in its file, and (u,) which these are.

    Raises:
        ValueError: a border point is not in the file.
    """
    import shapely

    drawn = list(seam_lines(lines))
    corners = np.concatenate([line.points for line in drawn])
    distances, nearest = cKDTree(corners).query(points)
    is_drawn = distances < TOLERANCE
    result = np.where(is_drawn[:, None], corners[nearest], points)
    # Straight parts of outlines are drawn without the points between their ends.
    between = np.flatnonzero(is_border & ~is_drawn)
    if len(between):
        tree = shapely.STRtree([shapely.LineString(_closed(line)) for line in drawn])
        places = shapely.points(points[between])
        along = tree.geometries[tree.nearest(places)]
        feet = shapely.line_interpolate_point(along, shapely.line_locate_point(along, places))
        result[between] = shapely.get_coordinates(feet)
        is_drawn[between] = shapely.distance(feet, places) < TOLERANCE
    if (is_border & ~is_drawn).any():
        raise ValueError(f"{(is_border & ~is_drawn).sum()} points of the pattern are not in the file")
    return result, is_drawn


def _closed(line: DrawnLine) -> np.ndarray:
    return np.concatenate([line.points, line.points[:1]]) if line.is_closed else line.points


def triangle_strains(
    vertices: np.ndarray, faces: np.ndarray, points: np.ndarray, corners: np.ndarray
) -> np.ndarray:
    """Return (m, 3) the relative changes of length of the sides of triangles from the model to the plane."""

    def lengths(places: np.ndarray) -> np.ndarray:
        return np.linalg.norm(places[:, [2, 0, 1]] - places[:, [1, 2, 0]], axis=2)

    return lengths(points[corners]) / lengths(vertices[faces]) - 1


def overlapping(lines: Sequence[DrawnLine]) -> int:
    """Return the number of outlines that intersect themselves, and of pairs of outlines that overlap."""
    import shapely

    areas = [shapely.Polygon(line.points) for line in lines if line.layer == "cut" and line.is_closed]
    invalid = sum(not area.is_valid for area in areas)
    first, second = shapely.STRtree(areas).query(areas, predicate="overlaps")
    return invalid + int((first < second).sum())
