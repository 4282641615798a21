"""Choices carried over to a mesh that has changed since they were made, for example in a modeller.

A vertex is carried over to the nearest one, paths along shortest paths between the vertices that they get, and painted
regions to all vertices of their area, so that they stay whole on a finer mesh.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from ... import MeshFile
from ...base import FloatArray, IntArray, list_some, plural
from ...linalg import MultiGraph
from .choices import Choices, Cone
from .paint import FLAGS, Paint, Region
from .paths import Path
from .pins import Pins
from .places import Places, file_edges

#: Largest distance to the nearest vertex, relative to the diagonal of the bounding box: farther away, a choice would
#: not be where its user has made it.
MAX_SHIFT = 0.05
#: A vertex within this share of the distance between painted vertices is painted, too. The points of a square grid are
#: covered from 0.71 on, and those of a triangular one from 0.58 on.
COVERED = 0.75


@dataclass(frozen=True)
class Carried:
    """Choices on a changed mesh.

    Attributes:
        choices: the choices.
        lost: texts on the choices that have no place on the mesh.
    """

    choices: Choices
    lost: tuple[str, ...]


def carried_over(choices: Choices, places: Places | None, mesh: MeshFile) -> Carried:
    """Return choices carried over to a mesh.

    Args:
        choices: the choices.
        places: where they were; None if that is unknown, so that they keep the numbers of their vertices.
        mesh: the mesh that they are carried over to.
    """
    ground = Ground(mesh)
    vertices = choices.vertices()
    if places is None:
        targets = np.where(vertices < len(mesh.vertices), vertices, -1)
        return _carried(choices, Transfer(ground, vertices, targets, None))
    targets = ground.nearest(places.points, ground.face_vertices)
    return _carried(choices, Transfer(ground, vertices, targets, places.points))


class Ground:
    """A mesh that choices are carried over to.

    Attributes:
        positions: (n, 3) positions of the vertices.
        edges: (e, 2) edges.
        face_vertices: (u,) vertices of faces, ascending, whose positions are finite.
        reach: largest distance to the nearest vertex.
    """

    def __init__(self, mesh: MeshFile) -> None:
        self.positions = np.asarray(mesh.vertices)
        self.edges = file_edges(mesh)
        vertices = np.unique(mesh.corners)
        self.face_vertices = vertices[np.isfinite(self.positions[vertices]).all(axis=1)]
        places = self.positions[self.face_vertices]
        extent = np.ptp(places, axis=0) if len(places) else np.zeros(3)
        self.reach = MAX_SHIFT * float(np.linalg.norm(extent))
        self._mesh = mesh

    @cached_property
    def boundary(self) -> IntArray:
        """Return the vertices at edges with a single triangle."""
        triangles = np.sort(self._mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        ends, counts = np.unique(triangles, axis=0, return_counts=True)
        return np.unique(ends[counts == 1])

    @cached_property
    def graph(self) -> MultiGraph:
        """Return the edges with their lengths."""
        tails, heads = self.positions[self.edges].transpose(1, 0, 2)
        return MultiGraph(len(self.positions), self.edges, np.linalg.norm(heads - tails, axis=1))

    def nearest(self, points: FloatArray, candidates: IntArray) -> IntArray:
        """Return (k,) the candidate that is nearest to each point; -1 if none is within reach."""
        from scipy.spatial import cKDTree

        candidates = candidates[np.isfinite(self.positions[candidates]).all(axis=1)]
        if not len(candidates) or not len(points):
            return np.full(len(points), -1)
        distance, which = cKDTree(self.positions[candidates]).query(points)
        return np.where(distance <= self.reach, candidates[which], -1)

    def covered(self, points: FloatArray) -> IntArray:
        """Return the vertices in the area between points, see `COVERED`."""
        from scipy.spatial import cKDTree

        if len(points) < 2 or not len(self.face_vertices):
            return np.empty(0, dtype=np.int64)
        tree = cKDTree(points)
        spacing = COVERED * tree.query(points, k=2)[0][:, 1]
        distance, which = tree.query(self.positions[self.face_vertices])
        return self.face_vertices[distance <= np.minimum(spacing, self.reach)[which]]

    def shortest_path(self, start: int, end: int) -> list[int]:
        """Return the vertices of the shortest path after its start; none if there is no path."""
        paths = self.graph.shortest_paths(np.array([start]), np.array([end]))
        path = [end]
        while path[-1] != start:
            before = int(paths.before[path[-1]])
            if before < 0:
                return []
            path.append(before)
        return path[-2::-1]


@dataclass(frozen=True, eq=False)
class Transfer:
    """The vertices that take the place of those of choices.

    Attributes:
        ground: the mesh.
        vertices: (k,) vertices of the choices, ascending.
        targets: (k,) those on the mesh, -1 if there is none.
        points: (k, 3) where the vertices were; None if that is unknown.
    """

    ground: Ground
    vertices: IntArray
    targets: IntArray
    points: FloatArray | None

    def vertex(self, vertex: int) -> int:
        """Return the vertex that takes the place of another; -1 if there is none."""
        return int(self.targets[np.searchsorted(self.vertices, vertex)])

    def path(self, path: Path) -> Path:
        """Return the path that takes the place of another, without detours into dead ends; () if there is none."""
        ends = [self.vertex(vertex) for vertex in path]
        if min(ends) < 0:
            return ()
        walk = ends[:1]
        for start, end in pairwise(ends):
            steps = [] if start == end else self.ground.shortest_path(start, end)
            if start != end and not steps:
                return ()
            for step in steps:
                if len(walk) > 1 and walk[-2] == step:
                    walk.pop()
                else:
                    walk.append(step)
        return tuple(walk) if len(walk) > 1 else ()

    def region(self, region: Region) -> tuple[Region, int]:
        """Return the region that takes the place of another, and the number of vertices without one."""
        where = np.searchsorted(self.vertices, region.vertices())
        targets = self.targets[where]
        is_lost = targets < 0
        covered = [] if self.points is None else [self.ground.covered(self.points[where[~is_lost]])]
        return Region.of_vertices(np.concatenate([targets[~is_lost], *covered])), int(is_lost.sum())

    def corner(self, vertex: int) -> int:
        """Return the vertex of the boundary that takes the place of another; -1 if there is none."""
        if self.points is None:
            return self.vertex(vertex)
        point = self.points[[np.searchsorted(self.vertices, vertex)]]
        return int(self.ground.nearest(point, self.ground.boundary)[0])


def _carried(choices: Choices, transfer: Transfer) -> Carried:
    cones, lost_cones = _cones(choices, transfer)
    cuts, lost_cuts = _paths(choices.cuts, transfer.path)
    uncut, lost_uncut = _paths(choices.uncut, transfer.path)
    paint, unpainted = _paint(choices.paint, transfer)
    corners = {transfer.corner(vertex) for vertex in choices.corners} - {-1}
    lost = (
        *([f"{plural(len(lost_cones), 'cone')} (at vertex {list_some(lost_cones)})"] if lost_cones else []),
        *([f"{plural(lost_cuts, 'cut')}"] if lost_cuts else []),
        *([f"{plural(lost_uncut, 'path')} to keep whole"] if lost_uncut else []),
        *([f"paint at {plural(unpainted, 'vertex', 'vertices')}"] if unpainted else []),
        *([plural(n, "corner")] if (n := len(choices.corners) - len(corners)) else []),
        *([plural(n, "pinned chart")] if (n := len(choices.pins.pins)) else []),
    )
    carried = replace(
        choices, cones=cones, cuts=cuts, uncut=uncut, paint=paint, corners=tuple(sorted(corners)), pins=Pins()
    )
    return Carried(carried, lost)


def _cones(choices: Choices, transfer: Transfer) -> tuple[tuple[Cone, ...], list[int]]:
    """Return the cones on the mesh, and the vertices of those without a place, or with that of another one."""
    cones: dict[int, Cone] = {}
    lost = []
    for cone in choices.cones:
        vertex = transfer.vertex(cone.vertex)
        if vertex < 0 or vertex in cones:
            lost.append(cone.vertex)
        else:
            cones[vertex] = replace(cone, vertex=vertex)
    return tuple(cones[vertex] for vertex in sorted(cones)), lost


def _paths(paths: tuple[Path, ...], carry: Callable[[Path], Path]) -> tuple[tuple[Path, ...], int]:
    """Return the paths on the mesh, and the number of those without a place."""
    carried = tuple(filter(None, map(carry, paths)))
    return carried, len(paths) - len(carried)


def _paint(paint: Paint, transfer: Transfer) -> tuple[Paint, int]:
    """Return the paint on the mesh, and the number of painted vertices without a place."""
    carried, lost = Paint(), 0
    for flag in FLAGS:
        region, lost_vertices = transfer.region(getattr(paint, flag))
        carried, lost = carried.with_flag(flag, region), lost + lost_vertices
    for weight, painted in paint.importance:
        region, lost_vertices = transfer.region(painted)
        carried, lost = carried.with_weight(weight, region), lost + lost_vertices
    return carried, lost
