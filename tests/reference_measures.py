"""Measures of UV coordinates, by their definitions: triangle by triangle, without anything of the package."""

from __future__ import annotations

from collections import defaultdict
from itertools import pairwise
from pathlib import Path

import numpy as np

#: Twice the area of a triangle without area, relative to the square of its longest side.
ZERO_AREA = 1e-12
#: Largest distance of UV points of one vertex that are joined, relative to the length of the edge.
SAME_POINT = 1e-6


def read_obj(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the positions, the triangles and their (m, 3, 2) UVs of an OBJ file, polygons as fans."""
    rows: dict[str, list[list[str]]] = defaultdict(list)
    for line in path.read_text().splitlines():
        kind, *words = line.split() or [""]
        rows[kind].append(words)
    fans = [(face[0], *pair) for face in rows["f"] for pair in pairwise(face[1:])]
    corners = np.array([[word.split("/")[:2] for word in fan] for fan in fans], dtype=int) - 1
    points = np.array([row[:2] for row in rows["vt"]], dtype=float)
    return np.array([row[:3] for row in rows["v"]], dtype=float), corners[..., 0], points[corners[..., 1]]


def measures(vertices: np.ndarray, faces: np.ndarray, uv: np.ndarray, pixels: int = 512) -> dict[str, float]:
    """Return the measures of a map by their names in reports."""
    singular, turns, areas = (
        np.array(values) for values in zip(*map(_map_of, vertices[faces], uv), strict=True)
    )
    is_flat = areas == 0
    is_lost = ~is_flat & (turns == 0)
    is_mapped = (turns != 0) & ~is_flat
    ratio = singular[is_mapped, 0] / singular[is_mapped, 1]
    weights, scale = areas[is_mapped], np.log(singular[is_mapped].prod(axis=1)) / 2
    order = np.argsort(ratio)
    reached = np.cumsum(weights[order]) / weights.sum()
    seams, joined = _edges(vertices, faces, uv)
    chart = _charts(len(faces), joined)
    flat_areas = np.array([_double_area(corners) / 2 for corners in uv])
    chart_areas = np.bincount(chart, flat_areas * is_mapped)
    sides = uv.reshape(-1, 2).max(axis=0) - uv.reshape(-1, 2).min(axis=0)
    lengths = np.array([length for length, _, _ in seams])
    first_lengths, second_lengths = np.array([flat for _, *flat in seams]).T
    return {
        "qc_mean": weights @ ratio / weights.sum(),
        "qc_p95": ratio[order][np.searchsorted(reached, 0.95)],
        "qc_max": ratio.max(),
        "area_std": np.sqrt(np.cov(scale, aweights=weights, ddof=0)),
        "flipped": np.count_nonzero(np.sign(turns) * np.sign(chart_areas)[chart] < 0),
        "mirrored_charts": np.count_nonzero(chart_areas < 0),
        "degenerate": np.count_nonzero(is_lost),
        "degenerate_input": np.count_nonzero(is_flat),
        "charts": len(chart_areas),
        "seam_length": lengths.sum() / np.sqrt(areas.sum()),
        "seam_mismatch": lengths
        @ (np.abs(first_lengths - second_lengths) / (first_lengths + second_lengths) * 2)
        / lengths.sum(),
        "box_efficiency": np.abs(flat_areas).sum() / sides.max() ** 2,
        "overlap": _overlap(uv, pixels),
    }


def _map_of(points: np.ndarray, flat: np.ndarray) -> tuple[np.ndarray, float, float]:
    """Return the singular values of the map of a triangle, its orientation (0 without area), and its area in space."""
    space, plane = points[1:] - points[0], flat[1:] - flat[0]
    normal = np.cross(*space)
    longest = max(np.linalg.norm(side) for side in (*space, space[1] - space[0]))
    if np.linalg.norm(normal) <= ZERO_AREA * longest**2:
        return np.ones(2), 0.0, 0.0
    frame, _ = np.linalg.qr(space.T)
    jacobian = np.linalg.solve(space @ frame, plane).T
    longest = max(np.linalg.norm(side) for side in (*plane, plane[1] - plane[0]))
    double = plane[0, 0] * plane[1, 1] - plane[0, 1] * plane[1, 0]
    turn = 0.0 if abs(double) <= ZERO_AREA * longest**2 else np.sign(double)
    return np.linalg.svd(jacobian, compute_uv=False), turn, np.linalg.norm(normal) / 2


def _double_area(flat: np.ndarray) -> float:
    (a, b), (c, d) = flat[1:] - flat[0]
    return a * d - b * c


def _edges(
    vertices: np.ndarray, faces: np.ndarray, uv: np.ndarray
) -> tuple[list[tuple[float, float, float]], list[tuple[int, int]]]:
    """Return the seam edges by their lengths in space and in the plane on either side, and the joined faces."""
    sides = defaultdict(list)
    for first, corners in enumerate(faces.tolist()):
        for k in range(3):
            start, end = corners[k], corners[(k + 1) % 3]
            places = {start: uv[first, k], end: uv[first, (k + 1) % 3]}
            sides[min(start, end), max(start, end)].append((first, places))
    seams, joined = [], []
    for (start, end), faces_of_edge in sides.items():
        if len(faces_of_edge) != 2:
            continue
        (first, first_places), (second, second_places) = faces_of_edge
        lengths = [
            float(np.linalg.norm(places[end] - places[start])) for places in (first_places, second_places)
        ]
        gap = max(np.linalg.norm(first_places[vertex] - second_places[vertex]) for vertex in (start, end))
        if gap <= SAME_POINT * max(lengths):
            joined.append((first, second))
        else:
            seams.append((float(np.linalg.norm(vertices[end] - vertices[start])), *lengths))
    return seams, joined


def _charts(count: int, joined: list[tuple[int, int]]) -> np.ndarray:
    """Return the chart of each face: the sets of faces that are joined."""
    root = list(range(count))

    def find(face: int) -> int:
        while root[face] != face:
            root[face] = face = root[root[face]]
        return face

    for first, second in joined:
        root[find(first)] = find(second)
    return np.unique([find(face) for face in range(count)], return_inverse=True)[1]


def _overlap(uv: np.ndarray, pixels: int) -> float:
    """Return the fraction of the covered pixels whose middles are inside more than one triangle."""
    low = uv.reshape(-1, 2).min(axis=0)
    places = (uv - low) / (uv.reshape(-1, 2).max(axis=0) - low).max() * pixels
    covered = np.zeros((pixels, pixels), dtype=int)
    for corners in places:
        turn = np.sign(_double_area(corners))
        start, end = np.floor(corners.min(axis=0)).astype(int), np.ceil(corners.max(axis=0)).astype(int)
        middles = np.stack(np.meshgrid(*map(np.arange, start, end), indexing="ij"), axis=-1) + 0.5
        inside = np.ones(middles.shape[:2], dtype=bool)
        for k in range(3):
            (a, b), (x, y) = corners[(k + 1) % 3] - corners[k], np.moveaxis(middles - corners[k], -1, 0)
            inside &= turn * (a * y - b * x) > 0
        covered[start[0] : end[0], start[1] : end[1]] += inside
    return float(np.count_nonzero(covered > 1) / np.count_nonzero(covered))
