"""Options from what a user gives, and functions that take them."""

from __future__ import annotations

import difflib
import inspect
import math
import textwrap
from collections.abc import Callable, Iterable, Mapping
from dataclasses import Field, fields
from typing import TYPE_CHECKING, Any, ParamSpec, Protocol, TypeVar, cast

from ..errors import OptionError
from .combined import Options
from .declared import WIDEST_CONE, Declaration

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

P = ParamSpec("P")
R = TypeVar("R")
G = TypeVar("G")
R_co = TypeVar("R_co", covariant=True)

#: Other spellings.
SPELLINGS = {"quantize": "quantise"}
#: Names of before, and what to say instead.
RENAMED = {
    "quantum": "quantise",
    "require": "required_cones",
    "forbid": "forbidden_cones",
    "only": "allowed_cones",
    "cone": "cones",
    "cones_file": "cones",
    "corner": "boundary",
    "keep_seams": "seams input",
}
#: Options of before that are none any more, and why.
GONE = {
    "at_cones": "where curvatures are given or searched for they are prescribed, else the scale is",
    "length_rule": "the linear metric scales edges by the integral of the paper",
    "lengths": "the linear metric scales edges by the integral of the paper",
}


def declarations(group: type) -> dict[str, tuple[Field[Any], Declaration]]:
    """Return the options of a group by name, each as a field and its declaration."""
    return {each.name: (each, each.metadata["declaration"]) for each in fields(group)}


def read_options(given: Mapping[str, Any], group: type[G] = Options) -> G:  # type: ignore[assignment]
    """Return options from keywords, each parsed.

    Args:
        given: name -> value.
        group: those that may be given.

    Raises:
        OptionError: there is no such option, a value makes no sense, or options do not go together.
    """
    known = declarations(group)
    parsed: dict[str, Any] = {}
    for name, value in given.items():
        name = SPELLINGS.get(name, name)
        if name not in known:
            raise OptionError(unknown_option(name, known))
        if name in parsed:
            raise OptionError(f"{name} is given twice, in two spellings")
        parsed[name] = known[name][1].kind.parse(name, value)
    widest = parsed.get("max_cone_angle")
    if widest is not None and WIDEST_CONE < widest <= math.inf:
        parsed["max_cone_angle"] = None  # no bound
    return group(**parsed)


def unknown_option(name: str, known: Iterable[str], prefix: str = "") -> str:
    """Return what is said of an option that does not exist.

    prefix: of names: "--" at the command line.
    """

    def spelled(each: str) -> str:
        return prefix + each.replace("_", "-") if prefix else each

    if name in RENAMED:
        return f"{spelled(name)} is now {spelled(RENAMED[name])}"
    if name in GONE:
        return f"there is no option {spelled(name)} any more: {GONE[name]}"
    near = difflib.get_close_matches(name, list(known), 1)
    return f"unknown option {spelled(name)}" + (f"; did you mean {spelled(near[0])}?" if near else "")


def settings(options: Options) -> dict[str, Any]:
    """Return options as plain values, for a report."""
    values: dict[str, Any] = {}
    for name, (_, declaration) in declarations(type(options)).items():
        value = getattr(options, name)
        if name == "lengths" and value is not None:
            values[name] = "given"
        if not declaration.flag:
            continue
        if isinstance(value, tuple) and name == "seams":
            value = [value[0], value[1].tolist()]
        elif hasattr(value, "tolist"):
            value = value.tolist() if "seams" in name else "given"
        elif name in ("weights", "seam_weights") and not isinstance(value, (str, type(None))):
            value = "given"
        values[name] = value
    return values


class OfMesh(Protocol[P, R_co]):
    """A function of a mesh with options."""

    def __call__(self, mesh: Any, faces: ArrayLike | None = None, *args: P.args, **options: P.kwargs) -> R_co:
        """Call it."""
        ...


def takes(declared: Callable[P, Any]) -> Callable[[Callable[..., R]], OfMesh[P, R]]:
    """Return a decorator that gives a function of a mesh, with `**options`, the keywords of a group of options.

    Type checkers and editors know the keywords from the group; its signature and docstring tell them when it runs.
    """

    def decorate(function: Callable[..., R]) -> OfMesh[P, R]:
        known = declarations(cast(type, declared))
        signature = inspect.signature(function)
        before = [each for each in signature.parameters.values() if each.kind is not each.VAR_KEYWORD]
        keywords = [
            inspect.Parameter(
                name, inspect.Parameter.KEYWORD_ONLY, default=each.default, annotation=each.type
            )
            for name, (each, _) in known.items()
        ]
        function.__signature__ = signature.replace(parameters=[*before, *keywords])  # type: ignore[attr-defined]
        lines = (
            textwrap.fill(
                f"{name}: {declaration.doc}", 110, initial_indent=" " * 8, subsequent_indent=" " * 12
            )
            for name, (_, declaration) in known.items()
        )
        function.__doc__ = (function.__doc__ or "").replace("        options: see below.", "\n".join(lines))
        return cast("OfMesh[P, R]", function)

    return decorate
