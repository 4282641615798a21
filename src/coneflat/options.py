"""The choices a flattening is made with."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from .errors import OptionError

CONES = ("greedy", "none")
METRICS = ("linear",)
LENGTH_RULES = ("integral", "mean")
LAYOUTS = ("least-squares",)

Cones = str | Mapping[int, float] | Iterable[int]

#: The published method: `flatten(mesh, **PAPER)`.
PAPER: Mapping[str, Any] = {
    "cones": "greedy",
    "epsilon": 1.0,
    "max_cones": None,
    "metric": "linear",
    "length_rule": "integral",
    "layout": "least-squares",
}


@dataclass(frozen=True)
class Options:
    """Checked options of `coneflat.flatten`, where each is explained.

    Raises:
        OptionError: a value makes no sense.
    """

    cones: Cones = "greedy"
    epsilon: float = 1.0
    max_cones: int | None = None
    metric: str = "linear"
    length_rule: str = "integral"
    layout: str = "least-squares"
    repair: bool = False
    strict: bool = False
    given: Mapping[int, float | None] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        if isinstance(self.cones, str):
            _choice("cones", self.cones, CONES)
        else:
            object.__setattr__(self, "given", _given_cones(self.cones))
        _choice("metric", self.metric, METRICS)
        _choice("length_rule", self.length_rule, LENGTH_RULES)
        _choice("layout", self.layout, LAYOUTS)
        epsilon = _number("epsilon", self.epsilon)
        if not 0 < epsilon < math.inf:
            raise OptionError(f"epsilon must be a positive number, not {epsilon:g}")
        if self.max_cones is not None and (
            isinstance(self.max_cones, bool) or self.max_cones != _whole("max_cones", self.max_cones)
        ):
            raise OptionError(f"max_cones must be a whole number, not {self.max_cones!r}")
        if self.max_cones is not None and self.max_cones < 0:
            raise OptionError(f"max_cones cannot be negative ({self.max_cones})")

    @property
    def method(self) -> str:
        """The way cones are found: "greedy", "none" or "given"."""
        return self.cones if isinstance(self.cones, str) else "given"

    def as_dict(self) -> dict[str, Any]:
        """Return the options as plain values, given cones as a map from vertex to curvature or None."""
        values = asdict(self)
        given = values.pop("given")
        return {**values, "cones": self.cones if isinstance(self.cones, str) else given}


def _choice(name: str, value: object, allowed: tuple[str, ...]) -> None:
    if value not in allowed:
        raise OptionError(f"unknown {name} {value!r}: choose from {', '.join(allowed)}")


def _number(name: str, value: object) -> float:
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError) as error:
        raise OptionError(f"{name} must be a number, not {value!r}") from error


def _whole(name: str, value: object) -> int:
    number = _number(name, value)
    if not number.is_integer():
        raise OptionError(f"{name} must be a whole number, not {value!r}")
    return int(number)


def _given_cones(cones: Mapping[int, float] | Iterable[int]) -> dict[int, float | None]:
    """Return vertex -> curvature, None where it is to be computed: for all cones or for none."""
    if isinstance(cones, Mapping):
        given: dict[int, float | None] = {
            _whole("a cone's vertex", v): None if k is None else _number("a cone's curvature", k)
            for v, k in cones.items()
        }
    else:
        try:
            listed = [_whole("a cone's vertex", v) for v in np.asarray(cones).ravel().tolist()]
        except TypeError as error:
            raise OptionError(
                f"cones must be a method's name, a list of vertices or a map from vertex to curvature, "
                f"not {type(cones).__name__}"
            ) from error
        given = dict.fromkeys(listed)
        if len(given) < len(listed):
            twice = next(v for v in listed if listed.count(v) > 1)
            raise OptionError(f"vertex {twice} is given as a cone twice")
    unknown = [v for v, k in given.items() if k is None]
    if unknown and len(unknown) < len(given):
        raise OptionError(
            f"{len(given) - len(unknown)} of {len(given)} cones have a curvature and vertex {unknown[0]} has "
            "none: give curvatures to all cones, or to none"
        )
    for v, k in given.items():
        if k is not None and not math.isfinite(k):
            raise OptionError(f"the curvature of cone {v} is {k}")
    return given
