"""Requirements on measures, such as `flipped=0,overlap=0,qc_mean<=1.05`."""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields

from ..errors import OptionError
from ..stages import SolveStatistics
from .report import MEASURES

_FORM = re.compile(r"\s*(?P<name>[A-Za-z_]\w*)\s*(?P<relation><=|>=|==|=|<|>)\s*(?P<bound>\S+)\s*")
_RELATIONS: dict[str, Callable[[float, float], bool]] = {
    "=": operator.eq,
    "<=": operator.le,
    ">=": operator.ge,
    "<": operator.lt,
    ">": operator.gt,
}

#: Numbers in the report of a flattening.
REPORTED = (
    "vertices",
    "triangles",
    "cones",
    *MEASURES,
    *(field.name for field in fields(SolveStatistics)),
    "rotation_deviation",
    "packing_efficiency",
    "uv_scale",
)


@dataclass(frozen=True)
class Requirement:
    """A bound on a measure.

    Attributes:
        name: the measure, as in the report.
        relation: "=", "<=", ">=", "<" or ">".
        bound: the number to the right of it.
    """

    name: str
    relation: str
    bound: float

    def __str__(self) -> str:
        return f"{self.name}{self.relation}{self.bound:g}"

    def breach(self, measures: Mapping[str, object]) -> str | None:
        """Return a message if a report violates the requirement, else None; unknown values violate it."""
        value = measures.get(self.name)
        if not isinstance(value, (int, float)) or not math.isfinite(value):
            return f"{self.name} has no value, but {self} is required"
        pairs = measures.get("overlapping_pairs")
        if self.name == "overlap" and value == 0 and isinstance(pairs, int) and pairs > 0:
            # Overlaps also count if their fraction of the area is rounded to zero.
            value = math.ulp(0.0)
        if _RELATIONS[self.relation](value, self.bound):
            return None
        return f"{self.name} is {value:.6g}, but {self} is required"


def parse_requirements(texts: Iterable[str], measures: Iterable[str]) -> tuple[Requirement, ...]:
    """Return requirements from texts such as "flipped=0,qc_mean<=1.05".

    Args:
        texts: each with one or more requirements, separated by commas.
        measures: names of measures.

    Raises:
        OptionError: a text is not a requirement, or its measure is unknown.
    """
    measures = tuple(measures)
    requirements = []
    for part in (part for text in texts for part in text.split(",")):
        match = _FORM.fullmatch(part)
        if match is None:
            raise OptionError(f"{part.strip()!r} is not a requirement; write flipped=0 or qc_mean<=1.05")
        name, relation = match["name"], "=" if match["relation"] == "==" else match["relation"]
        if name not in measures:
            raise OptionError(f"unknown measure {name!r}: choose from {', '.join(sorted(measures))}")
        try:
            bound = float(match["bound"])
        except ValueError:
            bound = math.nan
        if math.isnan(bound):
            raise OptionError(f"{part.strip()!r}: {match['bound']!r} is not a number")
        requirements.append(Requirement(name, relation, bound))
    return tuple(requirements)


def breaches(requirements: Iterable[Requirement], measures: Mapping[str, object]) -> tuple[str, ...]:
    """Return a message for each requirement that the measures of a report violate."""
    lines = (requirement.breach(measures) for requirement in requirements)
    return tuple(line for line in lines if line is not None)
