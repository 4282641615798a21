"""The commands' flags: made from the declarations of the options."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, Field
from typing import Any, TypeVar

import click
from click.core import ParameterSource

from ...errors import OptionError
from ...options import PAPER, Options, declarations
from ...options.declared import CONES, ConeOptions, Declaration, MetricOptions
from ...options.kinds import (
    Choice,
    Count,
    Direction,
    Edges,
    Flag,
    Number,
    Strength,
    Vertices,
    Weights,
    Whole,
    WordOrVertices,
)
from .values import is_file, parse_angle, read_pairs, read_vertex_map, read_vertices, read_weights

Command = TypeVar("Command", bound=Callable[..., Any])

#: Options that `shared.input_options` adds.
OF_INPUT = ("repair", "strict")
#: Other spellings of flags.
SPELLINGS = {"quantise": ("--quantize",), "quads": ("--faces",)}

paper_option = click.option(
    "--paper",
    is_flag=True,
    help="The method exactly as published (Ben-Chen et al. 2008), one chart per component.",
)


class Angle(click.ParamType):  # type: ignore[type-arg]
    """An angle such as 1.57, pi/2, 0.1pi or 90deg."""

    name = "angle"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return radians."""
        if isinstance(value, (int, float)) or value.strip().lower() == "inf":
            return float(value)
        try:
            return parse_angle(value)
        except OptionError as error:
            self.fail(str(error), param, ctx)


class HowMuch(click.ParamType):  # type: ignore[type-arg]
    """A strength."""

    name = "strength"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return a number."""
        try:
            return float(value)
        except ValueError:
            self.fail(f"{value!r} is no strength: write a number after it, 1 say", param, ctx)


class Axis(click.ParamType):  # type: ignore[type-arg]
    """A direction in space such as z, -y or 0,0.5,1."""

    name = "direction"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, float, float]:
        """Return its three coordinates."""
        if isinstance(value, tuple):
            return value
        text = value.strip().lower()
        axis = "xyz".find(text[-1:])
        if axis >= 0 and text[:-1] in ("", "+", "-"):
            length = -1.0 if text[0] == "-" else 1.0
            return (length * (axis == 0), length * (axis == 1), length * (axis == 2))
        try:
            one, two, three = (float(word) for word in text.split(","))
        except ValueError:
            self.fail(f"{value!r} is no direction; write z, -y or 0,0.5,1", param, ctx)
        return (one, two, three)


def flag_of(name: str) -> str:
    """Return the flag of an option."""
    return "--" + name.replace("_", "-")


def option_flags(group: type, *, one_mesh: bool) -> Callable[[Command], Command]:
    """Return a decorator that adds the flags of a group of options to a command, the group's own first.

    one_mesh: also those that name vertices of one mesh.
    """
    chosen = [
        (name, field, declaration)
        for name, (field, declaration) in own_first(group)
        if declaration.flag and name not in OF_INPUT and (one_mesh or _may_fit_any_mesh(declaration))
    ]

    def decorate(command: Command) -> Command:
        for name, field, declaration in reversed(chosen):
            command = _flag(name, field, declaration)(command)
        return command

    return decorate


def own_first(group: type) -> list[tuple[str, tuple[Field[Any], Declaration]]]:
    """Return the options of a group, its own before those of the groups that it is made of."""
    known = declarations(group)
    own = [name for name in vars(group).get("__annotations__", {}) if name in known]
    return [(name, known[name]) for name in dict.fromkeys([*own, *known])]


def _may_fit_any_mesh(declaration: Declaration) -> bool:
    """Whether an option has values that make sense for several meshes: words do, vertices do not."""
    return not declaration.one_mesh or bool(getattr(declaration.kind, "words", ()))


def _flag(name: str, field: Field[Any], declaration: Declaration) -> Callable[[Command], Command]:
    """Return what adds one flag; its value is None, or an empty tuple, where it is not given."""
    kind, more, flag = declaration.kind, dict[str, Any](), flag_of(name)
    if field.default is True:
        flag += f"/--no-{flag[2:]}"
    match kind:
        case Flag():
            more = {"is_flag": True, "default": None}
        case Choice():
            more = {"type": click.Choice(kind.words)}
            if len(kind.words) > 5:
                more["metavar"] = "NAME"
        case Number():
            more = {"type": Angle(), "metavar": "ANGLE"} if kind.is_angle else {"type": float}
        case Strength():
            more = {"type": HowMuch(), "is_flag": False, "flag_value": 1.0, "metavar": "STRENGTH"}
        case Count() | Whole():
            more = {"type": int}
        case Direction():
            more = {"type": Axis(), "metavar": "DIRECTION"}
        case Vertices():
            more = {"multiple": True, "metavar": "VERTICES|FILE"}
        case WordOrVertices():
            more = {"multiple": True, "metavar": "|".join((*kind.words, "VERTEX[:CURVATURE],...", "FILE"))}
        case Edges():
            more = {"multiple": True, "metavar": "|".join((*kind.words, "FILE"))}
        case Weights():
            more = {"metavar": "NAME|FILE"}
    listed = isinstance(kind, Choice) and len(kind.words) > 5
    doc = declaration.doc + (
        f" One of {', '.join(kind.words)}." if listed and isinstance(kind, Choice) else ""
    )
    shown = shown_default(field)
    doc += f"  [default: {shown}]" if shown else ""
    return click.option(flag, *SPELLINGS.get(name, ()), name, help=doc, **more)


def shown_default(field: Field[Any]) -> str:
    """Return an option's default as tables show it; "" where it stands for none."""
    value = field.default
    if value is MISSING or value is None or value is False or value == ():
        return ""
    if isinstance(field.metadata["declaration"].kind, Number) and field.metadata["declaration"].kind.is_angle:
        turns = value / math.pi
        return f"{turns:g}pi" if turns >= 1 else f"pi/{1 / turns:g}"
    if value is True:
        return "yes"
    return f"{value:g}" if isinstance(value, float) else str(value)


def keywords(params: Mapping[str, Any], group: type = Options) -> dict[str, Any]:
    """Return the keyword arguments of `coneflat.flatten` that a command line gives.

    Args:
        params: the command's.
        group: the options that it has.

    Raises:
        OptionError: vertices or weights are not what they should be.
        MeshFileError: a file of them cannot be read.
    """
    given = dict(PAPER) if params.get("paper") else {}
    for name, (_, declaration) in declarations(group).items():
        value = params.get(name)
        if name not in OF_INPUT and value is not None and value != ():
            given[name] = _value(name, declaration, value)
    return given


def _value(name: str, declaration: Declaration, value: Any) -> Any:
    """Return what a flag's texts mean."""
    kind, flag = declaration.kind, flag_of(name)
    match kind:
        case Vertices():
            return tuple(dict.fromkeys(v for text in value for v in read_vertices(flag, text)))
        case WordOrVertices():
            words = [text for text in value if text.replace("-", "").isalpha() and not is_file(text)]
            if words and len(value) > 1:
                raise OptionError(f"{flag} {words[0]} is one choice, and {value[0]}, {value[1]} are two")
            return words[0] if words else read_vertex_map(flag, kind.noun, value)
        case Edges():
            return _edges(flag, kind, value)
        case Weights():
            return read_weights(value)
    return value


def _edges(flag: str, kind: Edges, texts: Sequence[str]) -> Any:
    import numpy as np

    words = [text for text in texts if text in kind.words]
    files = [text for text in texts if text not in kind.words]
    if len(words) > 1:
        raise OptionError(f"{flag} {words[0]} is given twice")
    pairs = np.concatenate([read_pairs(text) for text in files]) if files else None
    if words and pairs is not None:
        return words[0], pairs
    return words[0] if words else pairs


def check_combinations(context: click.Context) -> None:
    """Refuse options that would have no effect."""
    params = context.params
    cones = params["cones"][0] if params["cones"] else "auto"
    method = params["method"] or "exact"
    known = declarations(Options)
    search = [name for name in declarations(ConeOptions) if name != "cones"]
    of_method = [*search, "cones", *(name for name in declarations(MetricOptions) if name != "best_effort")]
    only = {
        what: [name for name in known if known[name][1].only == what]
        for what in ("pursuit", "greedy", "exact")
    }
    searched = cones in ("auto", "pursuit")
    given = cones not in CONES
    rules = [
        (params["paper"], of_method, "--paper fixes the method"),
        (given, search, "with cones given there is nothing to search"),
        (cones == "none", search, "--cones none searches for none"),
        (cones == "greedy", only["pursuit"], "--cones greedy has no such choice"),
        (searched, only["greedy"], "only --cones greedy has this choice"),
        (params["cone_count"] is not None, ("distortion", "max_cones"), "the number of cones is given"),
        (method != "exact", only["exact"], f"--method {method} has no such choice"),
    ]
    for applies, names, reason in rules:
        for name in names if applies else ():
            if is_given(context, name):
                raise click.UsageError(f"{reason}: leave out {flag_of(name)}", context)


def is_given(context: click.Context, name: str) -> bool:
    """Whether an option stands at the command line."""
    return context.get_parameter_source(name) is ParameterSource.COMMANDLINE
