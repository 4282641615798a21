"""What the user has painted on the surface: where no cone lies, where no seam runs, what is important."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from ...base import shown
from ...errors import StudioError
from ...options import as_number

#: A region in words: numbers, and first and last of those that follow each other.
_RUN = re.compile(r"([0-9]{1,15})(?:-([0-9]{1,15}))?")
#: What is painted beside importance.
FLAGS = ("no_cone", "no_seam")
MOST_IMPORTANT = 1e6
#: Vertices that may be painted: more than any mesh has that a browser draws, and few enough to be counted out.
MOST_PAINTED = 20_000_000

Runs = tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class Region:
    """A set of vertices; as text, a tenth of what numbers take: every step that can be undone has some.

    Attributes:
        text: numbers, and first and last of those that follow each other, ascending: "3-17 20".
    """

    text: str = ""

    @classmethod
    def of_runs(cls, runs: Iterable[tuple[int, int]]) -> Region:
        """Return what runs, first and last vertex of each, make together."""
        return cls(" ".join(str(a) if a == b else f"{a}-{b}" for a, b in _merged(runs)))

    @classmethod
    def of_text(cls, text: object) -> Region:
        """Return what a text such as "3-17 20" names.

        Raises:
            StudioError: it is no such text, or names too many vertices.
        """
        if not isinstance(text, str):
            raise StudioError(f"a region is written as 3-17 20, not {shown(text)}")
        runs = []
        for word in text.split():
            found = _RUN.fullmatch(word)
            first, last = (found[1], found[2] or found[1]) if found else ("1", "0")
            if int(first) > int(last):
                raise StudioError(f"a region is written as 3-17 20; {shown(word)} is not part of one")
            runs.append((int(first), int(last)))
        region = cls.of_runs(runs)
        if region.count > MOST_PAINTED:
            raise StudioError(
                f"{region.count:,} painted vertices are more than the {MOST_PAINTED:,} that may be"
            )
        return region

    @property
    def runs(self) -> Runs:
        """First and last of the vertices that follow each other, ascending; they neither overlap nor touch."""
        ends = (word.partition("-") for word in self.text.split())
        return tuple((int(first), int(last or first)) for first, _, last in ends)

    @property
    def count(self) -> int:
        """How many vertices it has."""
        return sum(last - first + 1 for first, last in self.runs)

    def vertices(self) -> list[int]:
        """Return its vertices, ascending."""
        return [vertex for first, last in self.runs for vertex in range(first, last + 1)]

    def joined(self, other: Region) -> Region:
        """Return what is in this one or in the other."""
        return Region.of_runs((*self.runs, *other.runs))

    def without(self, other: Region) -> Region:
        """Return what is in this one and not in the other."""
        left, at = [], 0
        taken = (*other.runs, (2**53, 2**53))  # above all vertices
        for first, last in self.runs:
            begin = first
            while taken[at][1] < begin:
                at += 1
            while taken[at][0] <= last:
                if begin < taken[at][0]:
                    left.append((begin, taken[at][0] - 1))
                begin = taken[at][1] + 1
                if begin > last:
                    break
                at += 1
            if begin <= last:
                left.append((begin, last))
        return Region.of_runs(left)

    def __bool__(self) -> bool:
        return bool(self.text)


def _merged(runs: Iterable[tuple[int, int]]) -> Runs:
    merged: list[tuple[int, int]] = []
    for first, last in sorted(runs):
        if merged and first <= merged[-1][1] + 1:
            merged[-1] = (merged[-1][0], max(last, merged[-1][1]))
        else:
            merged.append((first, last))
    return tuple(merged)


@dataclass(frozen=True)
class Paint:
    """What is painted; nothing of it ever changes.

    Attributes:
        no_cone: where searches put no cone.
        no_seam: where no seam runs.
        importance: weights, ascending, and where they are; elsewhere it is 1. These regions do not meet.
    """

    no_cone: Region = field(default_factory=Region)
    no_seam: Region = field(default_factory=Region)
    importance: tuple[tuple[float, Region], ...] = ()

    def flagged(self, flag: str, where: Region) -> Paint:
        """Return paint with more of a flag, one of `FLAGS`.

        Raises:
            StudioError: there is none of this name.
        """
        if flag in FLAGS:
            return replace(self, **{flag: getattr(self, flag).joined(where)})
        raise StudioError(f"nothing is painted as {shown(flag)}: choose from {', '.join(FLAGS)}, importance")

    def weighted(self, weight: float, where: Region) -> Paint:
        """Return paint with another weight of some vertices.

        Raises:
            StudioError: it is none.
        """
        if not 0 < weight <= MOST_IMPORTANT:
            raise StudioError(f"an importance is above 0 and at most {MOST_IMPORTANT:,.0f}, not {weight:g}")
        known = {each: region.without(where) for each, region in self.importance}
        if weight != 1:
            known[weight] = known.get(weight, Region()).joined(where)
        return replace(self, importance=tuple((each, known[each]) for each in sorted(known) if known[each]))

    def erased(self, where: Region) -> Paint:
        """Return paint with nothing at some vertices."""
        bare = replace(self, no_cone=self.no_cone.without(where), no_seam=self.no_seam.without(where))
        return bare.weighted(1.0, where)

    def __bool__(self) -> bool:
        return bool(self.no_cone or self.no_seam or self.importance)

    def weights(self) -> dict[int, float]:
        """Return vertex -> weight, of those that have one."""
        return {vertex: weight for weight, region in self.importance for vertex in region.vertices()}

    def as_plain(self) -> dict[str, Any]:
        """Return it as JSON holds it."""
        plain: dict[str, Any] = {flag: getattr(self, flag).text for flag in FLAGS if getattr(self, flag)}
        if self.importance:
            plain["importance"] = {repr(weight): region.text for weight, region in self.importance}
        return plain

    @classmethod
    def from_plain(cls, plain: Mapping[str, Any]) -> Paint:
        """Return paint that JSON holds.

        Raises:
            StudioError, OptionError: it makes no sense.
            AttributeError: it is none at all.
        """
        paint = cls()
        for name, given in plain.items():
            if name == "importance":
                for weight, text in given.items():
                    paint = paint.weighted(_weight(weight), Region.of_text(text))
            else:
                paint = paint.flagged(name, Region.of_text(given))
        return paint

    def stroked(self, layer: object, where: Region, weight: object) -> Paint:
        """Return paint after a stroke of a brush, of a layer: one of `FLAGS`, "importance", or "erase".

        Raises:
            StudioError, OptionError: there is no such layer, or no such weight.
        """
        if layer == "erase":
            return self.erased(where)
        if layer == "importance":
            return self.weighted(_weight(weight), where)
        return self.flagged(str(layer), where)


def _weight(given: object) -> float:
    """Return an importance from what JSON holds, where keys are text."""
    if isinstance(given, str):
        try:
            return float(given)
        except ValueError:
            return math.nan  # which is refused
    return as_number("an importance", given)
