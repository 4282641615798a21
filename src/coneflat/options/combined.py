"""All options of a flattening together: which go together, and what follows from them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from ..errors import OptionError
from .declared import (
    ITERATIVE,
    LEAST_QUANTUM,
    WIDEST_CONE,
    AtlasOptions,
    ConeOptions,
    MetricOptions,
    RunOptions,
    SeamOptions,
    SymmetryOptions,
)

# What asks for cones by the pursuit, and it alone.
ASKING = (
    "cone_count",
    "positive_only",
    "weights",
    "required_cones",
    "forbidden_cones",
    "allowed_cones",
    "quantise",
    "quality",
)


@dataclass(frozen=True, kw_only=True)
class Options(RunOptions, AtlasOptions, SymmetryOptions, SeamOptions, MetricOptions, ConeOptions):
    """Options of `coneflat.flatten`; `read_options` makes them from what a user gives, so that they are parsed.

    Raises:
        OptionError: options do not go together.
    """

    def __post_init__(self) -> None:
        self._check_method()
        self._check_angles()
        self._check_pursuit()
        if not 0 <= self.padding < self.resolution / 4:
            raise OptionError(
                f"padding must be from 0 to a quarter of the resolution of {self.resolution:,}, not {self.padding:g}"
            )
        if self.lengths is not None and self.refine:
            raise OptionError(
                "a refinement has triangles of its own, between positions, which given lengths do not tell: leave out "
                "refine"
            )
        if self.mirrored == "overlap" and (self.symmetric == "off" or self.charts != "atlas"):
            raise OptionError(
                "mirrored 'overlap' lays the sides of a symmetric model on each other: it needs an atlas and symmetry, "
                f"not charts {self.charts!r} and symmetric {self.symmetric!r}"
            )
        if self.sharp_angle is not None and not 0 < self.sharp_angle < math.pi:
            raise OptionError(f"the sharp angle must be between 0 and pi, not {self.sharp_angle:g} radians")

    def _check_method(self) -> None:
        if self.refine and (self.stretch or self.polish == "whole"):
            raise OptionError("a refinement carries the exact map, which is not relaxed: leave out refine")
        if self.method == "exact":
            return
        if self.stretch or self.polish == "whole":
            raise OptionError(
                f"method {self.method!r} gives layouts as published, unrelaxed: use method 'exact'"
            )
        if self.boundary_kind != "free":
            raise OptionError(f"method {self.method!r} has a free boundary: use method 'exact'")
        if self.best_effort and self.method not in ITERATIVE:
            raise OptionError(f"method {self.method!r} has no unfinished result to give: no best effort")
        if self.refine:
            raise OptionError(
                f"method {self.method!r} has no common subdivision to refine to: use method 'exact'"
            )

    def _check_angles(self) -> None:
        if not 0 < self.min_cone_angle <= WIDEST_CONE:
            raise OptionError(
                f"the smallest cone angle must be positive and at most {WIDEST_CONE / math.pi:g} pi, not "
                f"{self.min_cone_angle:g} radians"
            )
        if self.max_cone_angle is not None and not self.max_cone_angle > self.min_cone_angle:
            raise OptionError(
                f"the largest cone angle ({self.max_cone_angle:g} radians) must exceed the smallest "
                f"({self.min_cone_angle:g})"
            )

    def _check_pursuit(self) -> None:
        """Check the options that only a pursuit takes, and those of whole quanta."""
        if not self.searches_cones and self.asks_for_pursuit:
            # Cones without curvatures beside others with such have the least area distortion by weight.
            is_fitted = any(k is None for k in self.named_cones.values())
            given = [name for name in ASKING if self._is_set(name) and not (name == "weights" and is_fitted)]
            if given:
                raise OptionError(
                    f"{given[0]} is an option of cones 'pursuit', not of cones {self.cone_choice!r}"
                )
        if self.boundary_kind == "straight" and not self.searches_cones:
            raise OptionError("a straight boundary gets its corners from the search: use cones 'pursuit'")
        if self.quality is not None and not self.quality > 1:
            raise OptionError(f"quality must be above 1, which is conformal, not {self.quality:g}")
        if self.quality is not None and self.method != "exact":
            raise OptionError("quality is reached by more cones and relaxing: use method 'exact'")
        if self.quantise is None:
            if self.correct_handles:
                raise OptionError(
                    "rotations along handles are made whole for quantised cones only: give quantise, pi/2 say"
                )
            return
        if not LEAST_QUANTUM <= self.quantise <= 2 * math.pi * (1 + 1e-6):
            raise OptionError(
                f"the quantum must be from {LEAST_QUANTUM:g} radians, below which it restricts nothing, to 2 pi, not "
                f"{self.quantise:g}"
            )
        if self.correct_handles and self.method != "exact":
            raise OptionError("rotations along handles are corrected by method 'exact' only")

    def _is_set(self, name: str) -> bool:
        value = getattr(self, name)
        if value is None or name == "cone_count":
            return value is not None
        return bool(len(value)) if hasattr(value, "__len__") else bool(value)

    @cached_property
    def asks_for_pursuit(self) -> bool:
        """Whether something is said that only the pursuit of cones heeds."""
        return any(self._is_set(name) for name in ASKING)

    @property
    def cone_choice(self) -> str:
        """The way cones are found: "auto", "pursuit", "greedy", "none" or "given"."""
        return self.cones if isinstance(self.cones, str) else "given"

    @property
    def searches_cones(self) -> bool:
        """Whether the pursuit finds the cones, where the boundary is not prescribed."""
        return self.cone_choice in ("auto", "pursuit")

    @property
    def named_cones(self) -> Mapping[int, float | None]:
        """Cones that are given, with their curvatures or None."""
        return self.cones if isinstance(self.cones, Mapping) else {}

    @property
    def boundary_kind(self) -> str:
        """What the boundary becomes: "free", "lengths", "disk", "straight" or "polygon"."""
        return self.boundary if isinstance(self.boundary, str) else "polygon"

    @property
    def corners(self) -> Mapping[int, float | None]:
        """Corners of the boundary that are given, with their curvatures or None."""
        return self.boundary if isinstance(self.boundary, Mapping) else {}

    @property
    def prescribes_boundary(self) -> bool:
        """Whether vertices on the boundary have a curvature to keep."""
        return self.boundary_kind not in ("free", "lengths")

    @property
    def marks_seams(self) -> bool:
        """Whether there may be edges that are cut in any case."""
        return self.seams is not None or self.sharp_angle is not None

    @property
    def scale_at_cones(self) -> bool:
        """Whether phi = 0 is prescribed at cones, not curvature.

        It is where they have no curvatures that must hold: the pursuit keeps cone angles within bounds, which those
        that come out need not respect.
        """
        has_curvatures = self.searches_cones or any(k is not None for k in self.named_cones.values())
        return not has_curvatures and not self.prescribes_boundary
