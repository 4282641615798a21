"""Glue tabs along the seams of a net: on one side of each straight part of a seam, without collisions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from ....base import FloatArray, IntArray, plural
from ....geometry import corner_angles, dihedral_angles, edge_lengths
from ....io import imported
from ....mesh import NEXT, PREVIOUS, label_components
from ..pieces.borders import Borders, Side
from ..pieces.cut_surface import CutSurface
from ..pieces.development import MIN_FOLD_ANGLE
from ..pieces.polylines import ends_of_straight_parts
from .tab_places import PlacedTabs, areas_of, largest_area, shrunk

# Angle at the ends of a tab, radians, and the one of the tabs of sides without room for such a tab, mostly short ones;
# it is smaller beside narrow gaps.
END_ANGLE, STEEP_ANGLE = np.pi / 4, np.radians(75)
# Fractions that are tried: of the free angle at the ends, of the width, and of the room along the edge at that height.
ANGLE_SHARES = (1.0, 0.5)
HEIGHTS = (1.0, 0.75, 0.5, 0.35, 0.25)
SPANS = ((0.0, 1.0), (0.0, 0.6), (0.4, 1.0), (0.2, 0.8), (0.0, 0.3), (0.35, 0.65), (0.7, 1.0))
# Fraction of the length of its base that the insets of a tab may take.
MAX_INSETS = 0.95
# Fraction of the depth of the face that it is glued to which a tab may take.
MAX_DEPTH = 0.9
# Angle up to which a free angle at an end is not used, radians.
MIN_ANGLE = 0.02
# Distance of the two sides of a seam, relative to its length, below which it is closed in the plane.
CLOSED = 1e-5
NO_TABS = np.empty((0, 4, 2))


@dataclass(frozen=True, eq=False)
class Tab:
    """A glue tab.

    Attributes:
        polygon: (4, 2) its corners, mm, counterclockwise: from the start of its base on the border of the piece to its
            end. It is folded along its base.
        seam: index of its seam in `Borders.seams`.
        side: 0 or 1, the side of the seam.
        piece: the piece.
        edges: (2,) the first half-edge of the side on which its base is, and the one after the last.
    """

    polygon: FloatArray
    seam: int
    side: int
    piece: int
    edges: tuple[int, int]


@dataclass(frozen=True, eq=False)
class Tabs:
    """The glue tabs of a net.

    Attributes:
        tabs: the tabs, of which no two collide with each other or with a piece.
        lengths_without: (k,) lengths of the straight parts of seams at which there is no room for a tab.
    """

    tabs: tuple[Tab, ...]
    lengths_without: FloatArray

    @property
    def notes(self) -> tuple[str, ...]:
        """A sentence if tabs are missing."""
        count = len(self.lengths_without)
        if not count:
            return ()
        return (
            f"{count} of {plural(count + len(self.tabs), 'glue tab')} {'has' if count == 1 else 'have'} no room, the "
            f"longest edge without one is {self.lengths_without.max():.1f} mm: glue these with a strip behind, or make "
            "the model larger or the tabs narrower",
        )


def glue_tabs(surface: CutSurface, borders: Borders, width: float) -> Tabs:
    """Return glue tabs, one on one side of each straight part of a seam.

    Tabs are trapezoids of a given width with angles of 45 degrees. Where there is less room, they are lower, down to a
    quarter of the width, shorter, or have smaller angles, or steeper ends if that does not suffice. They fit below the
    face that they are glued to.

    Args:
        surface: a net, with pieces anywhere.
        borders: its borders.
        width: width of the tabs, mm; 0 for none.

    Raises:
        OptionError: shapely is not installed.
    """
    if width <= 0:
        return Tabs((), np.empty(0))
    parts = [
        part for number, seam in enumerate(borders.seams) for part in _parts(surface, number, seam.sides)
    ]
    room = _Room(surface, parts, width)
    return room.tabs()


@dataclass(frozen=True)
class _Part:
    """A straight part of a seam: half-edges i to j - 1 of the first side, and those of the second from the end."""

    seam: int
    sides: tuple[Side, Side]
    begin: int
    end: int

    def range_of(self, side: int) -> tuple[int, int]:
        """Return the half-edges on a side: the first, and the one after the last."""
        count = len(self.sides[0].halfedges)
        return (self.begin, self.end) if side == 0 else (count - self.end, count - self.begin)

    def halfedges(self, side: int) -> IntArray:
        """Return the half-edges on a side."""
        return self.sides[side].halfedges[slice(*self.range_of(side))]


def _parts(surface: CutSurface, seam: int, sides: tuple[Side, Side]) -> Iterator[_Part]:
    """Yield the parts of a seam that are straight on both sides; not those that are closed in the plane."""
    places = surface.points[sides[0].points], surface.points[sides[1].points[::-1]]
    for begin, end in pairwise(ends_of_straight_parts(*places).tolist()):
        first, second = (points[[begin, end]] for points in places)
        is_closed = sides[0].piece == sides[1].piece
        if is_closed and np.abs(first - second).max() <= CLOSED * np.linalg.norm(first[1] - first[0]):
            continue
        yield _Part(seam, sides, begin, end)


class _Room:
    """The room for tabs on both sides of the parts of seams.

    Args:
        surface: the net.
        parts: the p parts of its seams.
        width: the width of tabs.
    """

    def __init__(self, surface: CutSurface, parts: list[_Part], width: float) -> None:
        self.surface, self.parts, self.width = surface, parts, width
        self.shapely: Any = imported("shapely", "glue tabs need shapely", '"coneflat[patterns]"')
        size = 2 * width + np.ptp(surface.points, axis=0).max()
        self.shifts = np.stack([1.5 * size * surface.pieces, np.zeros(len(surface.pieces))], axis=1)
        self.places = surface.places + self.shifts[:, None]
        self.angles = corner_angles(edge_lengths(surface.mesh.vertices, surface.mesh.faces))

    @cached_property
    def faces(self) -> IntArray:
        """(m,) the face of each triangle: triangles that are joined without a fold."""
        mesh = self.surface.mesh
        is_flat = (np.abs(dihedral_angles(mesh)) <= MIN_FOLD_ANGLE) & ~mesh.is_boundary_edge
        is_flat[self.surface.seams] = False
        return label_components(len(mesh.faces), *mesh.edge_faces[is_flat].T)[1]

    @cached_property
    def free_angles(self) -> FloatArray:
        """(u,) the angle outside the piece at each point."""
        inside = np.bincount(self.surface.corners.ravel(), self.angles.ravel(), len(self.surface.points))
        return np.maximum(2 * np.pi - inside, 0)

    @cached_property
    def face_angles(self) -> FloatArray:
        """(m, 3) the angle of the face at each corner of a triangle, in all its triangles there."""
        key = self.faces[:, None] * len(self.surface.points) + self.surface.corners
        _, inverse = np.unique(key, return_inverse=True)
        sums = np.bincount(inverse.reshape(-1), self.angles.ravel())
        return sums[inverse.reshape(-1)].reshape(-1, 3)

    def tabs(self) -> Tabs:
        """Return the tabs: parts with the least room first, each on the side with more room that is left.

        Parts without room for a tab with gentle ends get one with steep ends, if there is room for that.
        """
        placed, choices = (
            PlacedTabs(self.shapely),
            {number: [NO_TABS, NO_TABS] for number in range(len(self.parts))},
        )
        for angle in (END_ANGLE, STEEP_ANGLE):
            remaining = [number for number in choices if number not in placed.items]
            trapezoids = [
                [self._trapezoids(self.parts[number], side, angle) for side in (0, 1)] for number in remaining
            ]
            choices.update(zip(remaining, self._free_of_pieces(trapezoids), strict=True))
            areas = [max(largest_area(sides) for sides in choices[number]) for number in remaining]
            for place in np.argsort(np.round(areas, 9), kind="stable").tolist():
                if not placed.put(remaining[place], choices[remaining[place]]):
                    placed.exchange(remaining[place], choices)
        tabs = [self._tab(number, side, polygon) for number, (side, polygon) in sorted(placed.items.items())]
        without = [self._length(part) for number, part in enumerate(self.parts) if number not in placed.items]
        return Tabs(tuple(tabs), np.array(without))

    def _length(self, part: _Part) -> float:
        edges = self.surface.mesh.halfedge_edges[part.halfedges(0)]
        return float(self.surface.edge_lengths[edges].sum())

    def _tab(self, number: int, side: int, polygon: FloatArray) -> Tab:
        part = self.parts[number]
        piece = part.sides[side].piece
        shift = self.shifts[part.sides[side].halfedges[0] // 3]
        return Tab(polygon - shift, part.seam, side, piece, part.range_of(side))

    def _trapezoids(self, part: _Part, side: int, angle: float) -> FloatArray:
        """Return (k, 4, 2) trapezoids on a side of a part, whether there is room or not; the largest first.

        Args:
            part: the part.
            side: 0 or 1.
            angle: the largest angle at their ends, radians.
        """
        halfedges, partners = part.halfedges(side), part.halfedges(1 - side)
        first, last = halfedges[0], halfedges[-1]
        triangle, corner = np.divmod(np.array([first, last]), 3)
        start, end = self.places[triangle[0], NEXT[corner[0]]], self.places[triangle[1], PREVIOUS[corner[1]]]
        length = float(np.linalg.norm(end - start))
        along = (end - start) / length
        outward = np.array([along[1], -along[0]])
        free = np.array(self._end_angles(first, last, partners))
        depth = MAX_DEPTH * self._depth(partners)
        corners = [
            outline
            for share in ANGLE_SHARES
            for outline in self._outlines(length, angle, share * free, depth)
        ]
        stations = np.unique(np.array(corners).reshape(-1, 4, 2), axis=0)
        polygons = start + stations[..., :1] * along + stations[..., 1:] * outward
        return polygons[np.argsort(-np.round(areas_of(polygons), 9), kind="stable")]

    def _outlines(
        self, length: float, angle: float, free: FloatArray, depth: float
    ) -> Iterator[list[tuple[float, float]]]:
        """Yield the corners of trapezoids, each along the part and outward from its start.

        Args:
            length: of the part.
            angle: the largest angle at their ends, radians.
            free: (2,) the free angles at the ends of the part, within which also shorter ones stay.
            depth: largest height.
        """
        if free.min() < MIN_ANGLE:
            return
        insets = 1 / np.tan(np.minimum(angle, free))
        highest = min(self.width, depth, MAX_INSETS * length / insets.sum())
        talls = {min(height * self.width, highest) for height in HEIGHTS}
        for tall in sorted(tall for tall in talls if tall >= HEIGHTS[-1] * self.width):
            left, right = tall * insets[0], length - tall * insets[1]
            foot = tall / np.tan(angle)
            for begin, stop in SPANS:
                top = left + begin * (right - left), left + stop * (right - left)
                base = (0.0 if begin == 0 else top[0] - foot), (length if stop == 1 else top[1] + foot)
                yield [(base[0], 0.0), (top[0], tall), (top[1], tall), (base[1], 0.0)]

    def _end_angles(self, first: int, last: int, partners: IntArray) -> tuple[float, float]:
        """Return the largest angles of a tab at both ends: outside its piece, and of the face that it is glued to."""
        corners = self.surface.corners
        tail = corners[first // 3, NEXT[first % 3]]
        head = corners[last // 3, PREVIOUS[last % 3]]
        at_head, at_tail = partners[0], partners[-1]
        return (
            min(self.free_angles[tail], self.face_angles[at_tail // 3, PREVIOUS[at_tail % 3]]),
            min(self.free_angles[head], self.face_angles[at_head // 3, NEXT[at_head % 3]]),
        )

    def _depth(self, partners: IntArray) -> float:
        """Return how far the face at a part reaches from it."""
        triangle, corner = partners[0] // 3, partners[0] % 3
        start, end = self.places[triangle, NEXT[corner]], self.places[triangle, PREVIOUS[corner]]
        along = (end - start) / np.linalg.norm(end - start)
        places = self.places[self.faces == self.faces[triangle]] - start
        return float(np.abs(along[0] * places[..., 1] - along[1] * places[..., 0]).max())

    def _free_of_pieces(self, trapezoids: list[list[FloatArray]]) -> list[list[FloatArray]]:
        """Return the trapezoids that do not collide with a piece."""
        tree = self.shapely.STRtree(self.shapely.polygons(self.places))
        flat = np.concatenate(
            [polygons for sides in trapezoids for polygons in sides] or [np.empty((0, 4, 2))]
        )
        hit = tree.query(self.shapely.polygons(shrunk(flat)), predicate="intersects")[0]
        is_free = np.ones(len(flat), dtype=bool)
        is_free[hit] = False
        sizes = [len(polygons) for sides in trapezoids for polygons in sides]
        parts = np.split(is_free, np.cumsum(sizes)[:-1])
        return [
            [sides[0][parts[2 * number]], sides[1][parts[2 * number + 1]]]
            for number, sides in enumerate(trapezoids)
        ]
