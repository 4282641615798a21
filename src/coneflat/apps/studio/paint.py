"""Painted regions of the surface: no cones, no seams, and importance."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...base import short_repr
from ...errors import StudioError
from ...options import as_number

#: A run of vertices in the text of a region: a vertex, or the first and the last one.
_RUN = re.compile(r"([0-9]{1,15})(?:-([0-9]{1,15}))?")
#: Layers of paint in addition to importance.
FLAGS = ("no_cone", "no_seam")
MAX_IMPORTANCE = 1e6
#: Largest number of painted vertices: above that of any mesh that a browser can draw, but small enough for lists.
MAX_PAINTED = 20_000_000


@dataclass(frozen=True)
class Region:
    """A set of vertices, stored as text, which needs a tenth of the memory of numbers in the undo history.

    Attributes:
        text: ascending vertices and ranges of consecutive vertices, such as "3-17 20".
    """

    text: str = ""

    @classmethod
    def of_vertices(cls, vertices: ArrayLike) -> Region:
        """Return the region of some vertices."""
        ascending = np.unique(np.asarray(vertices, dtype=np.int64))
        first = ascending[np.diff(ascending, prepend=-2) > 1].tolist()
        last = ascending[np.diff(ascending, append=2**62) > 1].tolist()
        return cls(" ".join(str(a) if a == b else f"{a}-{b}" for a, b in zip(first, last, strict=True)))

    @classmethod
    def of_text(cls, text: object) -> Region:
        """Return the region given by a text such as "3-17 20".

        Raises:
            StudioError: the text is not valid, or there are too many vertices.
        """
        if not isinstance(text, str):
            raise StudioError(f"a region must be a text such as 3-17 20, got {short_repr(text)}")
        runs, count = [np.empty(0, dtype=np.int64)], 0
        for word in text.split():
            match = _RUN.fullmatch(word)
            first, last = (match[1], match[2] or match[1]) if match else ("1", "0")
            if int(first) > int(last):
                raise StudioError(f"a region must be a text such as 3-17 20; {short_repr(word)} is not valid")
            count += int(last) - int(first) + 1
            if count > MAX_PAINTED:
                raise StudioError(f"{count:,} painted vertices are above the limit of {MAX_PAINTED:,}")
            runs.append(np.arange(int(first), int(last) + 1))
        return cls.of_vertices(np.concatenate(runs))

    @property
    def runs(self) -> tuple[tuple[int, int], ...]:
        """Return the first and last vertex of each maximal run of consecutive vertices, ascending."""
        ends = (word.partition("-") for word in self.text.split())
        return tuple((int(first), int(last or first)) for first, _, last in ends)

    def vertices(self) -> list[int]:
        """Return the vertices, ascending."""
        return [vertex for first, last in self.runs for vertex in range(first, last + 1)]

    def joined(self, region: Region) -> Region:
        """Return the union of two regions."""
        return Region.of_vertices(self.vertices() + region.vertices())

    def without(self, region: Region) -> Region:
        """Return the vertices of this region that are not in another."""
        return Region.of_vertices(np.setdiff1d(self.vertices(), region.vertices()))

    def __bool__(self) -> bool:
        return bool(self.text)


@dataclass(frozen=True)
class Paint:
    """The painted regions; immutable.

    Attributes:
        no_cone: vertices at which searches must not place cones.
        no_seam: vertices between which there must be no seams.
        importance: ascending weights and their regions, which are disjoint; elsewhere the weight is 1.
    """

    no_cone: Region = field(default_factory=Region)
    no_seam: Region = field(default_factory=Region)
    importance: tuple[tuple[float, Region], ...] = ()

    def with_flag(self, flag: str, where: Region) -> Paint:
        """Return paint with vertices added to a layer, one of `FLAGS`.

        Raises:
            StudioError: there is no such layer.
        """
        if flag in FLAGS:
            return replace(self, **{flag: getattr(self, flag).joined(where)})
        raise StudioError(f"unknown layer {short_repr(flag)}: choose from {', '.join(FLAGS)}, importance")

    def with_weight(self, weight: float, where: Region) -> Paint:
        """Return paint with another weight for some vertices.

        Raises:
            StudioError: the weight is not valid.
        """
        if not 0 < weight <= MAX_IMPORTANCE:
            raise StudioError(
                f"an importance must be above 0 and at most {MAX_IMPORTANCE:,.0f}, got {weight:g}"
            )
        regions = {factor: region.without(where) for factor, region in self.importance}
        if weight != 1:
            regions[weight] = regions.get(weight, Region()).joined(where)
        return replace(
            self,
            importance=tuple((factor, regions[factor]) for factor in sorted(regions) if regions[factor]),
        )

    def erased(self, where: Region) -> Paint:
        """Return paint with all layers erased at some vertices."""
        bare = replace(self, no_cone=self.no_cone.without(where), no_seam=self.no_seam.without(where))
        return bare.with_weight(1.0, where)

    def __bool__(self) -> bool:
        return bool(self.no_cone or self.no_seam or self.importance)

    def weights(self) -> dict[int, float]:
        """Return a map from vertex to weight, for the vertices with a weight other than 1."""
        return {vertex: weight for weight, region in self.importance for vertex in region.vertices()}

    def as_plain(self) -> dict[str, Any]:
        """Return the paint as values for JSON."""
        plain: dict[str, Any] = {flag: getattr(self, flag).text for flag in FLAGS if getattr(self, flag)}
        if self.importance:
            plain["importance"] = {repr(weight): region.text for weight, region in self.importance}
        return plain

    @classmethod
    def from_plain(cls, plain: Mapping[str, Any]) -> Paint:
        """Return the paint in values from JSON.

        Raises:
            StudioError, OptionError: a value is not valid.
            AttributeError, ValueError: the values do not have the structure of paint.
        """
        paint = cls()
        for name, layer in plain.items():
            if name == "importance":
                for weight, text in layer.items():
                    paint = paint.with_weight(float(weight), Region.of_text(text))
            else:
                paint = paint.with_flag(name, Region.of_text(layer))
        return paint

    def with_stroke(self, layer: object, where: Region, weight: object) -> Paint:
        """Return paint after a stroke of the brush; layer: one of `FLAGS`, "importance", or "erase".

        Raises:
            StudioError, OptionError: the layer is unknown, or the weight is not valid.
        """
        if layer == "erase":
            return self.erased(where)
        if layer == "importance":
            return self.with_weight(as_number("an importance", weight), where)
        return self.with_flag(str(layer), where)
