"""Bend lines of developable sheets: sharp bends between flat parts, and parts of cylinders."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...base import BoolArray, FloatArray, IntArray, mask_of
from ...geometry import dihedral_angles
from ...mesh import label_components
from .cut_surface import CutSurface
from .development import MIN_FOLD_ANGLE

# Largest angle between the facets of a cylinder, radians.
MAX_FACET_ANGLE = 0.6
# Largest relative difference of the widths of adjacent facets of a cylinder, and of the angles between them.
WIDTHS, ANGLES = 0.05, 0.1
# Largest sine of the angle between rulings that count as parallel.
PARALLEL = 1e-3
# Largest strain of a surface that is bent, and not stretched.
DEVELOPABLE = 1e-6


@dataclass(frozen=True, eq=False)
class Bend:
    """A bend of a sheet about a line: sharp, or a part of a cylinder.

    Attributes:
        piece: the piece.
        line: (2, 2) the ends of its centre line in the plane.
        angle: by how much the normal turns, radians: positive for a mountain seen from outside, else negative.
        radius: of the cylinder through the surface, 0 for a sharp bend.
        width: of the bent part in the plane across the line, 0 for a sharp bend.
    """

    piece: int
    line: FloatArray
    angle: float
    radius: float = 0.0
    width: float = 0.0


@dataclass(frozen=True, eq=False)
class _Crease:
    """A straight fold between two flat parts.

    Attributes:
        piece: the piece.
        parts: the two flat parts.
        line: (2, 2) its ends in the plane.
        angle: the dihedral angle, positive for a mountain.
    """

    piece: int
    parts: tuple[int, int]
    line: FloatArray
    angle: float

    @property
    def middle(self) -> FloatArray:
        """(2,) its middle."""
        return self.line.mean(axis=0)

    @property
    def direction(self) -> FloatArray:
        """(2,) a unit vector along it."""
        along = self.line[1] - self.line[0]
        return along / np.linalg.norm(along)

    def is_parallel_to(self, crease: _Crease) -> bool:
        """Return whether another crease has the same direction."""
        a, b = self.direction, crease.direction
        return bool(abs(a[0] * b[1] - a[1] * b[0]) <= PARALLEL)

    def distance_to(self, crease: _Crease) -> float:
        """Return the distance of the middle of another crease from the line of this one."""
        a, b = self.direction, crease.middle - self.middle
        return float(abs(a[0] * b[1] - a[1] * b[0]))


def largest_strains(surface: CutSurface) -> FloatArray:
    """Return (p,) the largest relative change of length in each piece."""
    strains = np.zeros(int(surface.pieces.max()) + 1)
    piece = surface.piece_of_point[surface.edges.ends[:, 0]]
    np.maximum.at(strains, piece, np.abs(surface.edges.strains(surface.points)))
    return strains


def find_bends(surface: CutSurface) -> tuple[Bend, ...]:
    """Return the bends of the developable pieces of a surface; pieces that are stretched have none.

    A sharp bend is a straight fold between two flat parts, from border to border. Facets of equal width between
    parallel folds with equal angles form a bend about a cylinder through their folds; the folds beside it, where it
    ends at flat parts, belong to it. Folds of cones are no bends.

    Args:
        surface: the surface in the plane.
    """
    is_stretched = largest_strains(surface) > DEVELOPABLE
    creases = [crease for crease in _creases(surface) if not is_stretched[crease.piece]]
    at_part: dict[int, list[int]] = {}
    for number, crease in enumerate(creases):
        for part in crease.parts:
            at_part.setdefault(part, []).append(number)
    strips = {part: numbers for part, numbers in at_part.items() if len(numbers) == 2}
    bends, done = [], set[int]()
    for chain in _chains(creases, strips):
        done.update(chain)
        if all(creases[chain[0]].is_parallel_to(creases[number]) for number in chain):
            bends.append(_cylinder([creases[number] for number in chain]))
    bends += [
        Bend(crease.piece, crease.line, crease.angle)
        for number, crease in enumerate(creases)
        if number not in done
    ]
    return tuple(bends)


def _creases(surface: CutSurface) -> list[_Crease]:
    """Return the straight folds that run from border to border."""
    mesh = surface.mesh
    angles = dihedral_angles(mesh)
    is_inside = ~mesh.is_boundary_edge & ~mask_of(len(mesh.edges), surface.seams)
    is_flat = is_inside & (np.abs(angles) <= MIN_FOLD_ANGLE)
    _, part = label_components(len(mesh.faces), *mesh.edge_faces[is_flat].T)
    edges = np.flatnonzero(is_inside & ~is_flat)
    pairs = np.sort(part[mesh.edge_faces[edges]], axis=1)
    edges, pairs = edges[pairs[:, 0] != pairs[:, 1]], pairs[pairs[:, 0] != pairs[:, 1]]
    order = np.lexsort([edges, pairs[:, 1], pairs[:, 0]])
    edges, pairs = edges[order], pairs[order]
    if not len(edges):
        return []
    starts = np.flatnonzero(np.r_[True, (pairs[1:] != pairs[:-1]).any(axis=1)])
    is_border = surface.is_border_vertex
    creases = []
    for group, pair in zip(np.split(edges, starts[1:]), pairs[starts].tolist(), strict=True):
        crease = _crease(surface, group, (pair[0], pair[1]), angles[group], is_border)
        if crease is not None:
            creases.append(crease)
    return creases


def _crease(
    surface: CutSurface, edges: IntArray, parts: tuple[int, int], angles: FloatArray, is_border: BoolArray
) -> _Crease | None:
    """Return the crease that consists of given edges; None if it is not straight or does not reach the border."""
    mesh = surface.mesh
    triangle, corner = np.divmod(mesh.edge_halfedges[edges, 0], 3)
    corners = np.stack([(corner + 1) % 3, (corner + 2) % 3], axis=1)
    places = surface.points[surface.corners[triangle[:, None], corners]].reshape(-1, 2)
    vertices = mesh.faces[triangle[:, None], corners].ravel()
    longest = np.linalg.norm(places[1::2] - places[::2], axis=1).argmax()
    along = places[2 * longest + 1] - places[2 * longest]
    along /= np.linalg.norm(along)
    stations = places @ along
    first, last = stations.argmin(), stations.argmax()
    line = places[[first, last]]
    across = (places - line[0]) @ np.array([-along[1], along[0]])
    length = stations[last] - stations[first]
    if np.abs(across).max() > PARALLEL * length or not is_border[vertices[[first, last]]].all():
        return None
    return _Crease(int(surface.pieces[triangle[0]]), parts, line, float(np.median(angles)))


def _chains(creases: list[_Crease], strips: dict[int, list[int]]) -> Iterator[list[int]]:
    """Yield the creases of cylinders and cones in their order.

    Args:
        creases: all creases.
        strips: the two creases of each flat part that is a facet between two.
    """
    widths = {part: (creases[a].distance_to(creases[b]) + creases[b].distance_to(creases[a])) / 2
              for part, (a, b) in strips.items()}  # fmt: skip
    inner = [number for number, crease in enumerate(creases) if _is_inside_bend(crease, widths)]
    neighbours = {number: set[int]() for number in inner}
    of_part: dict[int, int] = {}
    for number in inner:
        for part in creases[number].parts:
            if part in of_part and _are_alike(creases[number], creases[of_part[part]]):
                neighbours[number].add(of_part[part])
                neighbours[of_part[part]].add(number)
            of_part[part] = number
    remaining = set(inner)
    for start in inner:
        if start not in remaining:
            continue
        chain = _path_through(start, neighbours)
        remaining -= set(chain)
        yield _with_ends(chain, creases, strips)


def _is_inside_bend(crease: _Crease, widths: dict[int, float]) -> bool:
    """Return whether a crease is between two facets of equal width."""
    first, second = (widths.get(part) for part in crease.parts)
    if first is None or second is None or abs(crease.angle) > MAX_FACET_ANGLE:
        return False
    return abs(first - second) <= WIDTHS * max(first, second)


def _are_alike(first: _Crease, second: _Crease) -> bool:
    """Return whether two creases have nearly the same angle."""
    return abs(first.angle - second.angle) <= ANGLES * max(abs(first.angle), abs(second.angle))


def _path_through(start: int, neighbours: dict[int, set[int]]) -> list[int]:
    """Return the path through a node of a graph whose nodes have two neighbours at most."""
    path = [start]
    for side in sorted(neighbours[start]):
        before, node, branch = start, side, list[int]()
        while node not in path and node not in branch:
            branch.append(node)
            following = neighbours[node] - {before}
            if not following:
                break
            before, node = node, min(following)
        path = path[::-1] + branch if path[0] == start and len(path) > 1 else path + branch
    return path


def _with_ends(chain: list[int], creases: list[_Crease], strips: dict[int, list[int]]) -> list[int]:
    """Return a chain with the creases at its ends, where a cylinder meets flat parts, if they turn no more."""
    angle = creases[chain[0]].angle
    for place in (0, -1):
        for part in creases[chain[place]].parts:
            for number in strips[part]:
                turn = creases[number].angle
                if number not in chain and 0 < turn / angle <= 1 + ANGLES:
                    chain = [number, *chain] if place == 0 else [*chain, number]
    return chain


def _cylinder(creases: list[_Crease]) -> Bend:
    """Return the bend of parallel creases about a cylinder, in their order."""
    first, last = creases[0], creases[-1]
    inner = max(creases, key=lambda crease: abs(crease.angle))
    place = creases.index(inner)
    neighbour = creases[place + 1] if place + 1 < len(creases) else creases[place - 1]
    width = inner.distance_to(neighbour)
    along = first.direction
    stations = np.concatenate([crease.line for crease in creases]) @ along
    across = np.array([-along[1], along[0]])
    centre = ((first.middle + last.middle) / 2) @ across
    line = np.outer([stations.min(), stations.max()], along) + centre * across
    radius = width / (2 * np.sin(abs(inner.angle) / 2))
    angle = sum(crease.angle for crease in creases)
    return Bend(first.piece, line, angle, float(radius), first.distance_to(last))
