"""Bend lines of developable sheets: sharp bends between flat parts, and parts of cylinders."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....base import FloatArray
from ..pieces.cut_surface import CutSurface
from .creases import Crease, find_creases, folds_and_parts

# Largest angle between the facets of a cylinder, radians.
MAX_FACET_ANGLE = 0.6
# Largest relative difference of the widths of the two facets beside a single fold of a cylinder, and of the radii at
# adjacent folds.
WIDTHS, RADII = 0.05, 0.1
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


def largest_strains(surface: CutSurface) -> FloatArray:
    """Return (p,) the largest relative change of length in each piece."""
    strains = np.zeros(int(surface.pieces.max()) + 1)
    piece = surface.piece_of_point[surface.edges.ends[:, 0]]
    np.maximum.at(strains, piece, np.abs(surface.edges.strains(surface.points)))
    return strains


def find_bends(surface: CutSurface) -> tuple[Bend, ...]:
    """Return the bends of the developable pieces of a surface; pieces that are stretched have none.

    A sharp bend is a straight fold between two flat parts, from border to border. Facets between parallel folds form a
    bend about a cylinder if the circles through three adjacent folds have one radius. The folds beside it, where it
    ends at flat parts, belong to it, and a last facet at the border of the piece. Folds of cones are no bends.

    Args:
        surface: the surface in the plane.
    """
    is_stretched = largest_strains(surface) > DEVELOPABLE
    creases = [crease for crease in find_creases(surface) if not is_stretched[crease.piece]]
    at_part: dict[int, list[int]] = {}
    for number, crease in enumerate(creases):
        for part in crease.parts:
            at_part.setdefault(part, []).append(number)
    strips = _Strips(creases, at_part, _reaches(surface, creases, at_part))
    bends, done = [], set[int]()
    for chain in strips.chains():
        if done.isdisjoint(chain):
            radius = strips.radius_of(chain)
            chain = strips.with_ends(chain, radius)
            done.update(chain)
            if all(creases[chain[0]].is_parallel_to(creases[number]) for number in chain):
                bends.append(strips.cylinder(chain, radius))
    bends += [
        Bend(crease.piece, crease.line, crease.angle)
        for number, crease in enumerate(creases)
        if number not in done
    ]
    return tuple(bends)


def _reaches(surface: CutSurface, creases: list[Crease], at_part: dict[int, list[int]]) -> dict[int, float]:
    """Return how far each part with a single crease reaches from it."""
    part, reaches = folds_and_parts(surface)[1], {}
    for label, beside in at_part.items():
        if len(beside) == 1:
            crease = creases[beside[0]]
            along, offsets = crease.direction, surface.places[part == label].reshape(-1, 2) - crease.middle
            reaches[label] = float(np.abs(along[0] * offsets[:, 1] - along[1] * offsets[:, 0]).max())
    return reaches


class _Strips:
    """The flat parts between creases, which may be facets of cylinders.

    Args:
        creases: all creases.
        at_part: the creases of each flat part.
        reaches: how far each part with a single crease reaches from it.
    """

    def __init__(
        self, creases: list[Crease], at_part: dict[int, list[int]], reaches: dict[int, float]
    ) -> None:
        self.creases = creases
        self.between = {
            part: numbers
            for part, numbers in at_part.items()
            if len(numbers) == 2 and creases[numbers[0]].is_beside(creases[numbers[1]])
        }
        self.widths = dict(reaches)
        for part, (a, b) in self.between.items():
            self.widths[part] = (creases[a].distance_to(creases[b]) + creases[b].distance_to(creases[a])) / 2

    def chains(self) -> list[list[int]]:
        """Return the creases inside cylinders and cones in their order, those of the smallest radius first."""
        inner = [
            number
            for number, crease in enumerate(self.creases)
            if all(part in self.between for part in crease.parts) and abs(crease.angle) <= MAX_FACET_ANGLE
        ]
        neighbours = {number: set[int]() for number in inner}
        of_part: dict[int, int] = {}
        for number in inner:
            for part in self.creases[number].parts:
                if part in of_part and self._are_alike(number, of_part[part]):
                    neighbours[number].add(of_part[part])
                    neighbours[of_part[part]].add(number)
                of_part[part] = number
        remaining, chains = set(inner), []
        for start in inner:
            if start in remaining:
                chain = _path_through(start, neighbours)
                remaining -= set(chain)
                if len(chain) > 1 or self._is_even(chain[0]):
                    chains.append(chain)
        return sorted(chains, key=lambda chain: self._radius(chain[0]))

    def with_ends(self, chain: list[int], radius: float) -> list[int]:
        """Return a chain with the creases at its ends, where a cylinder meets flat parts or its last facet."""
        sign = np.sign(self.creases[chain[0]].angle)
        for place in (0, -1):
            for part in self.creases[chain[place]].parts:
                for number in self.between[part]:
                    turn = sign * self.creases[number].angle
                    limit = (1 + RADII) * 2 * _half_angle(self.widths[part], radius)
                    if number not in chain and (0 < turn <= limit or self._ends_with_facet(number, radius)):
                        chain = [number, *chain] if place == 0 else [*chain, number]
        return chain

    def cylinder(self, chain: list[int], radius: float) -> Bend:
        """Return the bend of parallel creases about a cylinder, in their order."""
        creases = [self.creases[number] for number in chain]
        first, last = creases[0], creases[-1]
        along = first.direction
        across = np.array([-along[1], along[0]])
        stations = np.concatenate([crease.line for crease in creases]) @ along
        ends = np.array([first.middle, last.middle]) @ across
        angle = sum(crease.angle for crease in creases)
        outward = 1.0 if ends[1] >= ends[0] else -1.0
        for end, number in ((0, chain[0]), (1, chain[-1])):
            if self._ends_with_facet(number, radius):
                width = self.widths[self._border_part(number)]
                ends[end] += (outward if end else -outward) * width
                angle += np.sign(angle) * _half_angle(width, radius)
        line = np.outer([stations.min(), stations.max()], along) + ends.mean() * across
        return Bend(first.piece, line, float(angle), radius, float(abs(ends[1] - ends[0])))

    def _radius(self, number: int) -> float:
        """Return the radius of the circle through a crease and the far ends of the parts beside it."""
        crease = self.creases[number]
        a, b = (self.widths[part] for part in crease.parts)
        chord = np.sqrt(a**2 + b**2 + 2 * a * b * np.cos(crease.angle))
        return float(chord / (2 * np.sin(abs(crease.angle))))

    def radius_of(self, chain: list[int]) -> float:
        """Return the radius of a cylinder at the creases inside it."""
        return float(np.median([self._radius(number) for number in chain]))

    def _are_alike(self, first: int, second: int) -> bool:
        """Return whether two creases turn in the same direction with nearly the same radius."""
        a, b = self._radius(first), self._radius(second)
        is_same = self.creases[first].angle * self.creases[second].angle > 0
        return bool(is_same and abs(a - b) <= RADII * min(a, b))

    def _is_even(self, number: int) -> bool:
        """Return whether the facets beside a crease are equally wide."""
        a, b = (self.widths[part] for part in self.creases[number].parts)
        return abs(a - b) <= WIDTHS * max(a, b)

    def _border_part(self, number: int) -> int:
        """Return the part beside a crease that has no other crease, -1 if there is none."""
        parts = [part for part in self.creases[number].parts if part not in self.between]
        return parts[0] if len(parts) == 1 and parts[0] in self.widths else -1

    def _ends_with_facet(self, number: int, radius: float) -> bool:
        """Return whether the part at the border beside a crease continues a cylinder of a radius."""
        if self._border_part(number) < 0 or abs(self.creases[number].angle) > MAX_FACET_ANGLE:
            return False
        return abs(self._radius(number) - radius) <= RADII * radius


def _half_angle(width: float, radius: float) -> float:
    """Return half the angle that a facet spans on a cylinder."""
    return float(np.arcsin(min(width / (2 * radius), 1.0)))


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
