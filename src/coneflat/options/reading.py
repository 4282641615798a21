"""Parsing of options from keywords, and a decorator for functions with options."""

from __future__ import annotations

import difflib
import inspect
import math
import textwrap
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, ParamSpec, Protocol, TypeVar, cast

from ..errors import OptionError
from .combined import Options
from .declared import WIDEST_CONE, InputOptions, declarations
from .kinds import Edges, VerticesOrEdges, Weights

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

P = ParamSpec("P")
R = TypeVar("R")
G = TypeVar("G")
R_co = TypeVar("R_co", covariant=True)

#: Alternative spellings of option names.
SPELLINGS = {"quantize": "quantise"}


def read_options(values: Mapping[str, Any], group: type[G] = Options) -> G:  # type: ignore[assignment]
    """Return parsed options from keywords.

    Args:
        values: map from name to value.
        group: the class with the allowed options.

    Raises:
        OptionError: an option is unknown, a value is invalid, or options contradict each other.
    """
    declared = declarations(cast(type, group))
    parsed: dict[str, Any] = {}
    for name, value in values.items():
        name = SPELLINGS.get(name, name)
        if name not in declared:
            similar = difflib.get_close_matches(name, list(declared), 1)
            raise OptionError(f"unknown option {name}" + (f"; did you mean {similar[0]}?" if similar else ""))
        if name in parsed:
            raise OptionError(f"{name} is given twice, in different spellings")
        parsed[name] = declared[name].kind.parse(name, value)
    widest = parsed.get("max_cone_angle")
    if widest is not None and WIDEST_CONE < widest <= math.inf:
        parsed["max_cone_angle"] = None  # no bound
    return group(**parsed)


def settings(options: InputOptions) -> dict[str, Any]:
    """Return options as plain Python values, for a report."""
    values: dict[str, Any] = {}
    for name, declaration in declarations(cast(type, type(options))).items():
        value = getattr(options, name)
        if isinstance(declaration.kind, (Edges, VerticesOrEdges)):
            value = [value[0], value[1].tolist()] if isinstance(value, tuple) else value
            value = value.tolist() if hasattr(value, "tolist") else value
        elif isinstance(declaration.kind, Weights) or name == "lengths":
            value = value if value is None or isinstance(value, str) else "given"
        if name != "progress" and (name != "lengths" or value is not None):
            values[name] = value
    return values


class OfMesh(Protocol[P, R_co]):
    """A function of a mesh with options."""

    def __call__(self, mesh: Any, faces: ArrayLike | None = None, *args: P.args, **options: P.kwargs) -> R_co:
        """Call the function with a mesh and options."""
        ...


def takes(declared: Callable[P, Any]) -> Callable[[Callable[..., R]], OfMesh[P, R]]:
    """Return a decorator that adds the keywords of a group of options to a function of a mesh with `**options`.

    Type checkers and editors see the keywords of the group. At run time they are in the function's signature and
    docstring.

    Args:
        declared: dataclass whose fields are options.
    """

    def decorate(function: Callable[..., R]) -> OfMesh[P, R]:
        declarations_of_group = declarations(cast(type, declared)).values()
        signature = inspect.signature(function)
        parameters = [p for p in signature.parameters.values() if p.kind is not p.VAR_KEYWORD]
        keywords = [
            inspect.Parameter(
                declaration.name,
                inspect.Parameter.KEYWORD_ONLY,
                default=declaration.default,
                annotation=declaration.type,
            )
            for declaration in declarations_of_group
        ]
        function.__signature__ = signature.replace(parameters=[*parameters, *keywords])  # type: ignore[attr-defined]
        lines = (
            textwrap.fill(
                f"{declaration.name}: {declaration.doc}",
                110,
                initial_indent=" " * 8,
                subsequent_indent=" " * 12,
            )
            for declaration in declarations_of_group
        )
        function.__doc__ = (function.__doc__ or "").replace("        options: see below.", "\n".join(lines))
        return cast("OfMesh[P, R]", function)

    return decorate
