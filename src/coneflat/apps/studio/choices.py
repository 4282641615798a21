"""What the user of the studio has chosen, and what that means as options of `coneflat.flatten`."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from types import MappingProxyType
from typing import Any

import numpy as np

from ...errors import OptionError, StudioError
from ...options import Options, declarations, read_options
from ...options.kinds import Flag, as_number, as_whole
from ...text import shown

#: Options that are chosen as they are; cones and seams are chosen one by one.
PLAIN = (
    "distortion", "cone_count", "boundary", "stretch", "charts", "sharp_angle", "creases", "hide_seams", "resolution",
    "padding", "repair",
)  # fmt: skip
#: Those of them that say how many cones a search is to find.
NUMBERS = ("distortion", "cone_count")
#: Boundaries that need no corners to be named, nor a search for them.
BOUNDARIES = ("free", "lengths", "disk", "straight")

Path = tuple[int, ...]


@dataclass(frozen=True)
class Cone:
    """A cone that the user has placed.

    Attributes:
        vertex: of the input.
        angle: its cone angle, radians; None where the best one is to be computed.
        locked: searches keep it where it is.
    """

    vertex: int
    angle: float | None = None
    locked: bool = False

    @property
    def curvature(self) -> float | None:
        """What its angle lacks of a full turn, radians."""
        return None if self.angle is None else 2 * math.pi - self.angle


@dataclass(frozen=True)
class Choices:
    """What the user has chosen; nothing of it ever changes, a change makes another.

    Attributes:
        options: those of `PLAIN` that are not left at their defaults.
        by_hand: `cones` are all there are; else a search places others around those that are locked.
        cones: those placed or locked, by vertex.
        cuts: paths along edges, as vertices, that are cut.
        kept: paths along edges that must not be cut.
    """

    options: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    by_hand: bool = False
    cones: tuple[Cone, ...] = ()
    cuts: tuple[Path, ...] = ()
    kept: tuple[Path, ...] = ()

    # Options.

    def with_option(self, name: str, value: Any) -> Choices:
        """Return choices with another value of an option; a number of cones, or a distortion, starts a search.

        Raises:
            OptionError: it is none that the studio has, or the value makes no sense.
        """
        if name not in PLAIN:
            raise OptionError(f"the studio sets no option {shown(name)}: it has {', '.join(PLAIN)}")
        if name == "boundary" and value not in BOUNDARIES:
            raise OptionError(f"unknown boundary {shown(value)}: choose from {', '.join(BOUNDARIES)}")
        kept, declared = dict(self.options), declarations(Options)[name]
        value = declared[1].kind.parse(name, value)
        for other in NUMBERS if name in NUMBERS else (name,):
            kept.pop(other, None)
        if value != declared[0].default or isinstance(declared[1].kind, Flag):
            kept[name] = value
        chosen = replace(self, options=MappingProxyType(kept))
        return chosen.searching() if name in NUMBERS else chosen

    def searching(self) -> Choices:
        """Return choices with a search, which keeps the places of the cones that are locked."""
        locked = tuple(replace(cone, angle=None) for cone in self.cones if cone.locked)
        return replace(self, by_hand=False, cones=locked)

    # Cones.

    def placed(self, found: Iterable[int]) -> Choices:
        """Return choices by hand: the cones that a search has found, at these vertices, become the user's."""
        if self.by_hand:
            return self
        known = {cone.vertex: cone for cone in self.cones}
        return self._with_cones(by_hand=True, cones=known | {v: Cone(v) for v in found if v not in known})

    def added(self, vertex: int, angle: float | None = None) -> Choices:
        """Return choices with a cone more.

        Raises:
            StudioError: there is one already.
        """
        if vertex in self._by_vertex():
            raise StudioError(f"vertex {vertex} is a cone already")
        return self._with_cones(cones=self._by_vertex() | {vertex: Cone(vertex, angle)})

    def moved(self, vertex: int, to: int) -> Choices:
        """Return choices with a cone elsewhere.

        Raises:
            StudioError: there is no cone, or there is one at the other place.
        """
        if vertex == to:
            return self
        cones = self._by_vertex()
        cone = self._cone(vertex)
        if to in cones:
            raise StudioError(f"vertex {to} is a cone already")
        del cones[vertex]
        return self._with_cones(cones=cones | {to: replace(cone, vertex=to)})

    def removed(self, vertex: int) -> Choices:
        """Return choices without a cone.

        Raises:
            StudioError: there is none.
        """
        self._cone(vertex)
        return self._with_cones(cones={v: cone for v, cone in self._by_vertex().items() if v != vertex})

    def angled(self, vertex: int, angle: float | None) -> Choices:
        """Return choices with another angle, radians, of a cone, or one that is to be computed.

        Raises:
            StudioError: there is no cone, or no cone has such an angle.
        """
        if angle is not None and not 0 < angle < math.inf:
            raise StudioError(f"a cone has a positive angle, not {math.degrees(angle):g} degrees")
        return self._with_cones(cones=self._by_vertex() | {vertex: replace(self._cone(vertex), angle=angle)})

    def locked(self, vertex: int, locked: bool) -> Choices:
        """Return choices in which searches keep a cone where it is, or need not; one that was found is kept by this."""
        cones = self._by_vertex()
        cone = replace(cones.get(vertex, Cone(vertex)), locked=locked)
        if vertex not in cones and (self.by_hand or not locked):
            raise StudioError(f"vertex {vertex} is no cone")
        cones[vertex] = cone
        if not self.by_hand and not locked:
            del cones[vertex]
        return self._with_cones(cones=cones)

    # Seams.

    def cut(self, path: Path) -> Choices:
        """Return choices with a path that is cut."""
        return replace(self, cuts=(*self.cuts, _checked(path)))

    def keep_whole(self, path: Path) -> Choices:
        """Return choices with a path that must not be cut."""
        return replace(self, kept=(*self.kept, _checked(path)))

    def erased(self, one: int, two: int) -> Choices:
        """Return choices without the paths that run along the edge between two vertices.

        Raises:
            StudioError: none does.
        """
        edge = frozenset((one, two))
        cuts = tuple(path for path in self.cuts if edge not in _edges(path))
        kept = tuple(path for path in self.kept if edge not in _edges(path))
        if len(cuts) + len(kept) == len(self.cuts) + len(self.kept):
            raise StudioError(f"no path was drawn along the edge {one}-{two}")
        return replace(self, cuts=cuts, kept=kept)

    # What they mean.

    def keywords(self) -> dict[str, Any]:
        """Return the keyword arguments of `coneflat.flatten` that they mean.

        Raises:
            OptionError: they do not go together.
        """
        words = {
            name: value for name, value in self.options.items() if not (self.by_hand and name in NUMBERS)
        }
        if self.by_hand:
            words |= self._cones_by_hand()
        elif self.cones:
            words["required_cones"] = [cone.vertex for cone in self.cones]
        for name, paths in (("seams", self.cuts), ("forbidden_seams", self.kept)):
            if paths:
                edges = {tuple(sorted(edge)) for path in paths for edge in _edges(path)}
                words[name] = np.array(sorted(edges), dtype=np.int64)
        read_options(words)
        return words

    def _cones_by_hand(self) -> dict[str, Any]:
        vertices = [cone.vertex for cone in self.cones]
        if not vertices:
            return {"cones": "none"}
        if any(cone.angle is not None for cone in self.cones):
            return {"cones": {cone.vertex: cone.curvature for cone in self.cones}}
        # A search that has nothing to choose finds the angles of the least area distortion.
        return {"required_cones": vertices, "allowed_cones": vertices}

    def as_plain(self) -> dict[str, Any]:
        """Return them as JSON holds them."""
        return {
            "options": dict(self.options),
            "by_hand": self.by_hand,
            "cones": [
                {"vertex": cone.vertex, "angle": cone.angle, "locked": cone.locked} for cone in self.cones
            ],
            "cuts": [list(path) for path in self.cuts],
            "kept": [list(path) for path in self.kept],
        }

    @classmethod
    def from_plain(cls, plain: Mapping[str, Any]) -> Choices:
        """Return choices that JSON holds.

        Raises:
            OptionError, StudioError: they make no sense.
            KeyError, TypeError, ValueError, AttributeError: they are no choices at all.
        """
        chosen = cls()
        for name, value in plain["options"].items():
            chosen = chosen.with_option(name, value)
        cones = {}
        for each in plain["cones"]:
            vertex = as_whole("a cone's vertex", each["vertex"])
            angle = None if each["angle"] is None else as_number("a cone's angle", each["angle"])
            if vertex in cones:
                raise StudioError(f"vertex {vertex} is a cone twice")
            if angle is not None and not 0 < angle < math.inf:
                raise StudioError(f"a cone has a positive angle, not {angle:g}")
            cones[vertex] = Cone(vertex, angle, each["locked"] is True)
        chosen = chosen._with_cones(by_hand=plain["by_hand"] is True, cones=cones)
        for path in plain["cuts"]:
            chosen = chosen.cut(tuple(path))
        for path in plain["kept"]:
            chosen = chosen.keep_whole(tuple(path))
        chosen.keywords()
        return chosen

    def _by_vertex(self) -> dict[int, Cone]:
        return {cone.vertex: cone for cone in self.cones}

    def _cone(self, vertex: int) -> Cone:
        cones = self._by_vertex()
        if vertex not in cones:
            raise StudioError(f"vertex {vertex} is no cone")
        return cones[vertex]

    def _with_cones(self, *, cones: Mapping[int, Cone], by_hand: bool | None = None) -> Choices:
        by_hand = self.by_hand if by_hand is None else by_hand
        # In order of their vertices: the same cones are the same choices, however they came about.
        return replace(self, by_hand=by_hand, cones=tuple(cones[v] for v in sorted(cones)))


def _checked(path: Iterable[Any]) -> Path:
    vertices = tuple(as_whole("a path's vertex", vertex) for vertex in path)
    if len(vertices) < 2 or any(a == b for a, b in pairwise(vertices)):
        raise StudioError(f"a path leads from one vertex to others, not along {shown(list(vertices))}")
    return vertices


def _edges(path: Path) -> set[frozenset[int]]:
    return {frozenset(edge) for edge in pairwise(path)}
