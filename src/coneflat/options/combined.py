"""All options of a flattening: checks of their combinations, and values derived from them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

from ..base.defaults import MIN_QUANTUM, TYPED_TOLERANCE
from ..errors import OptionError
from .declared import WIDEST_CONE, AtlasOptions, ConeOptions, MetricOptions, RunOptions, SeamOptions

# Options that only the sparse search for cones supports.
SEARCH_OPTIONS = ("cone_count", "positive_only", "weights", "required_cones", "forbidden_cones", "quantise")


def _degrees_advice(angle: float) -> str:
    """Return how to write an angle in degrees, for one that is hardly in radians; "" for others."""
    if not 4 * math.pi < angle <= 720:
        return ""
    return f"; for {angle:g} degrees write {angle:g}deg, in Python math.radians({angle:g})"


@dataclass(frozen=True, kw_only=True)
class Options(ConeOptions, MetricOptions, SeamOptions, AtlasOptions, RunOptions):
    """Parsed options of `coneflat.flatten`, as `read_options` returns them.

    Raises:
        OptionError: options contradict each other.
    """

    def __post_init__(self) -> None:
        for message in (*self._metric_errors(), *self._cone_errors(), *self._other_errors()):
            raise OptionError(message)

    def _metric_errors(self) -> Iterator[str]:
        """Yield an error message for each conflict of the metric options."""
        moves_all = self.stretch or self.relax == "whole"
        if self.method != "exact":
            if moves_all:
                yield f"method {self.method!r} does not relax layouts: use method 'exact'"
            if self.boundary_kind != "free":
                yield f"method {self.method!r} has a free boundary: use method 'exact'"
            if self.correct_handles:
                yield "correct_handles needs method 'exact'"

    def _cone_errors(self) -> Iterator[str]:
        """Yield an error message for each conflict of the cone options."""
        smallest, widest, quantum = self.min_cone_angle, self.max_cone_angle, self.quantise
        if not 0 < smallest <= WIDEST_CONE:
            largest = f"{WIDEST_CONE / math.pi:g} pi"
            expected = f"the smallest cone angle must be positive and at most {largest}"
            yield f"{expected}, got {smallest:g} radians{_degrees_advice(smallest)}"
        if widest is not None and not widest > smallest:
            advice = _degrees_advice(smallest)
            yield f"the largest cone angle ({widest:g} radians) must exceed the smallest ({smallest:g}){advice}"
        if not self.searches_cones:
            # The curvatures of given cones without one minimize the weighted area distortion. If all are given, handles
            # can be corrected to a quantum, and a straight boundary has corners among them.
            is_fitted = None in self.named_cones.values()
            allowed = "weights" if is_fitted else "quantise" if self.cone_choice == "prescribed" else ""
            for name in SEARCH_OPTIONS:
                if self._is_set(name) and name != allowed:
                    yield f"{name} is an option of cones 'sparse', not of cones {self.cone_choice!r}"
            if self.boundary_kind == "straight" and allowed != "quantise":
                yield "boundary 'straight' needs the cone search, which finds its corners: use cones 'sparse'"
        if quantum is None and self.correct_handles:
            yield "correct_handles needs quantised cones: set quantise, for example to pi/2"
        if quantum is not None and not MIN_QUANTUM <= quantum <= 2 * math.pi * (1 + TYPED_TOLERANCE):
            yield (
                f"quantise must be from {MIN_QUANTUM:g} radians (a smaller quantum has no effect) to 2 pi, got "
                f"{quantum:g}{_degrees_advice(quantum)}"
            )

    def _other_errors(self) -> Iterator[str]:
        """Yield an error message for each conflict of the options of seams and atlas."""
        if not 0 <= self.padding < self.resolution / 4:
            largest = f"a quarter of the resolution of {self.resolution:,}"
            yield f"padding must be from 0 to {largest}, got {self.padding:g}"
        if self.sharp_angle is not None and not 0 < self.sharp_angle < math.pi:
            advice = _degrees_advice(self.sharp_angle)
            yield f"the sharp angle must be between 0 and pi, got {self.sharp_angle:g} radians{advice}"

    def _is_set(self, name: str) -> bool:
        value = getattr(self, name)
        return value is not None and value is not False and (not hasattr(value, "__len__") or len(value) > 0)

    @cached_property
    def asks_for_search(self) -> bool:
        """Whether an option is set that only the sparse search supports."""
        return any(self._is_set(name) for name in SEARCH_OPTIONS)

    @property
    def cone_choice(self) -> str:
        """How cones are found: "auto", "sparse", "greedy", "none" or "prescribed"."""
        return self.cones if isinstance(self.cones, str) else "prescribed"

    @property
    def searches_cones(self) -> bool:
        """Whether the sparse search finds the cones, where the boundary is not prescribed."""
        return self.cone_choice in ("auto", "sparse")

    @property
    def named_cones(self) -> Mapping[int, float | None]:
        """Cones given by the user, with their curvatures or None."""
        return self.cones if isinstance(self.cones, Mapping) else {}

    @property
    def boundary_kind(self) -> str:
        """The kind of boundary: "free", "lengths", "disk", "straight" or "polygon"."""
        return self.boundary if isinstance(self.boundary, str) else "polygon"

    @property
    def corners(self) -> Mapping[int, float | None]:
        """Corners of the boundary given by the user, with their curvatures or None."""
        return self.boundary if isinstance(self.boundary, Mapping) else {}

    @property
    def marks_seams(self) -> bool:
        """Whether edges may be marked as seams, by `seams` or by `sharp_angle`."""
        return self.seams is not None or self.sharp_angle is not None

    @property
    def scale_at_cones(self) -> bool:
        """Whether phi = 0 is prescribed at cones instead of their curvature.

        This is the case if cones have no prescribed curvatures. Searched cones keep their curvatures, because the
        resulting cone angles might violate the bounds that the search respects.
        """
        has_curvatures = self.searches_cones or self.named_cones
        return not has_curvatures and self.boundary_kind in ("free", "lengths")
