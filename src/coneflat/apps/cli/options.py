"""The options of the commands, created from the declarations of the options."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, cast

import click
from click.core import ParameterSource

from ... import PAPER
from ... import options as declared
from ...errors import OptionError
from ...options import ConeOptions, Declaration, Kind, MetricOptions, Number, Options, declarations, option
from ...quadmesh.options import Sizes
from . import values
from .shared import BRIEF, RARE_TITLE, Grouped, repair_keywords

Command = TypeVar("Command", bound=Callable[..., Any])
G = TypeVar("G")

#: Names of the options that `shared.input_options` adds.
INPUT_NAMES = ("repair", "strict")
#: Further spellings of options.
SPELLINGS = {"quantise": ("--quantize",), "quads": ("--faces",), "output": ("-o",)}

paper_option = click.option(
    "--paper",
    cls=Grouped,
    group="Metric",
    is_flag=True,
    help="The published method (Ben-Chen et al. 2008), one chart per component.",
)


@dataclass(frozen=True)
class ClickKind(Kind):
    """The kind of an option of a command that click converts from text.

    Attributes:
        arguments: further arguments of `click.option`.
    """

    arguments: Mapping[str, Any]


def flag(default: Any = None, **arguments: Any) -> Any:
    """Return a field of an option that only a command has; `arguments`: those of `click.option`."""
    return option(default, ClickKind(arguments))


def path_flag(default: Path | None = None, **arguments: Any) -> Any:
    """Return a field of an option that only a command has and that is a path."""
    return flag(default, type=click.Path(path_type=Path), **arguments)


def _angle(value: Any) -> float:
    """Return an angle in radians from 1.57, pi/2, 0.1pi, 90deg, inf, or none, which is inf."""
    try:
        return math.inf if value.strip().lower() in ("inf", "none") else values.parse_angle(value)
    except OptionError as error:
        raise click.BadParameter(str(error)) from error


def _strength(value: Any) -> float:
    """Return the strength as a number."""
    try:
        return float(value)
    except ValueError as error:
        raise click.BadParameter(f"{value!r} is not a number; write a strength such as 1") from error


def _direction(value: Any) -> tuple[float, float, float]:
    """Return a (3,) direction from z, -y or 0,0.5,1."""
    text = value.strip().lower()
    axis = "xyz".find(text[-1:])
    if text and axis >= 0 and text[:-1] in ("", "+", "-"):
        length = -1.0 if text[0] == "-" else 1.0
        return (length * (axis == 0), length * (axis == 1), length * (axis == 2))
    try:
        x, y, z = (float(word) for word in text.split(","))
    except ValueError as error:
        raise click.BadParameter(f"{value!r} is not a direction; write z, -y or 0,0.5,1") from error
    return (x, y, z)


def parse_eye(value: Any) -> Any:
    """Return three numbers from 1,0.5,2; or the text itself if it is words such as front-right."""
    try:
        return tuple(float(number) for number in value.split(",")) if "," in value else value
    except ValueError as error:
        raise click.BadParameter(f"{value!r} is not a direction; write 1,0.5,2 or front-right") from error


def flag_name(name: str) -> str:
    """Return the flag of an option, such as "--max-cones" of "max_cones"."""
    return "--" + name.replace("_", "-")


def option_flags(group: type, *, one_mesh: bool = True) -> Callable[[Command], Command]:
    """Return a decorator that adds a group of options to a command.

    one_mesh: also add options that refer to vertices of one mesh.
    """
    shown = [
        declaration
        for declaration in declarations(group).values()
        if declaration.flag and declaration.name not in INPUT_NAMES
    ]

    def decorate(command: Command) -> Command:
        for declaration in reversed(shown):
            command = _flag(declaration)(command) if one_mesh or _may_fit_any_mesh(declaration) else command
        return command

    return decorate


def _may_fit_any_mesh(declaration: Declaration) -> bool:
    """Return whether an option has values that apply to several meshes: words do, vertices do not."""
    return not declaration.one_mesh or bool(getattr(declaration.kind, "words", ()))


def _flag(declaration: Declaration) -> Callable[[Command], Command]:
    """Return a decorator that adds one option; its value is None, or an empty tuple, if it is not given."""
    kind, name = declaration.kind, declaration.name
    arguments, spelled, doc = dict[str, Any](), flag_name(name), declaration.doc
    if declaration.default is True:
        spelled += f"/--no-{spelled[2:]}"
    match kind:
        case ClickKind():
            arguments = dict(kind.arguments)
        case _ if kind.metavar:
            arguments = {"metavar": kind.metavar}
        case declared.Flag():
            arguments = {"is_flag": True, "default": None}
        case declared.Choice():
            arguments = {"type": click.Choice(kind.words)}
            if len(kind.words) > 5:
                arguments["metavar"] = "NAME"
                doc += f" One of {', '.join(kind.words)}."
        case Number(is_angle=True):
            arguments = {"type": _angle, "metavar": "ANGLE"}
        case Number(is_strength=True):
            arguments = {"type": _strength, "is_flag": False, "flag_value": 1.0, "metavar": "STRENGTH"}
        case Number():
            arguments = {"type": int if kind.is_integer else float}
        case declared.Direction():
            arguments = {"type": _direction, "metavar": "DIRECTION"}
        case declared.Vertices() | declared.VerticesOrEdges():
            arguments = {"multiple": True, "metavar": "VERTICES|FILE"}
        case declared.WordOrVertices():
            arguments = {
                "multiple": True,
                "metavar": "|".join((*kind.words, "VERTEX[:CURVATURE],...", "FILE")),
            }
        case declared.Edges():
            arguments = {"multiple": True, "metavar": "|".join((*kind.words, "FILE"))}
        case declared.Weights():
            arguments = {"metavar": "NAME|FILE"}
    title = RARE_TITLE if name in declared.RARE else declaration.group
    if name in BRIEF:
        doc = doc.split(". ")[0].rstrip(".") + "."
    shown = shown_default(declaration)
    doc += f"  [default: {shown}]" if shown else ""
    names = (spelled, *SPELLINGS.get(name, ()), name)
    return click.option(*names, cls=Grouped, group=title, help=doc, **arguments)


def shown_default(declaration: Declaration) -> str:
    """Return the default of an option as a text; "" if there is none."""
    value = declaration.default
    if value is None or value is False or value == ():
        return ""
    if isinstance(declaration.kind, Number) and declaration.kind.is_angle:
        turns = value / math.pi
        return f"{turns:g}pi" if turns >= 1 else f"pi/{1 / turns:g}"
    if value is True:
        return "yes"
    return f"{value:g}" if isinstance(value, float) else str(value)


def keywords(params: Mapping[str, Any], group: type = Options) -> dict[str, Any]:
    """Return the keyword arguments of `coneflat.flatten` for the parameters of a command.

    Args:
        params: the parameters of the command, among them "repair".
        group: the group of options to read.

    Raises:
        OptionError: a value cannot be parsed.
        MeshFileError: a file of them cannot be read.
    """
    options = dict(PAPER) if params.get("paper") else {}
    for name, declaration in declarations(group).items():
        value = params.get(name)
        if name not in INPUT_NAMES and value is not None and value != ():
            options[name] = _value(declaration, value)
    return {**options, **repair_keywords(params["repair"])}


def pop_flags(params: dict[str, Any], group: type[G]) -> G:
    """Remove the options of a group from the parameters of a command, and return the group."""
    flags = {name: params.pop(name) for name in declarations(cast(type, group))}
    return group(**{name: value for name, value in flags.items() if value is not None and value != ()})


def _value(declaration: Declaration, value: Any) -> Any:
    """Return the value that the texts of an option stand for."""
    kind, flag = declaration.kind, flag_name(declaration.name)
    match kind:
        case declared.Vertices():
            return tuple(dict.fromkeys(v for text in value for v in values.read_vertices(flag, text)))
        case declared.VerticesOrEdges():
            return values.read_vertices_or_pairs(flag, value)
        case declared.WordOrVertices():
            words = [text for text in value if text.replace("-", "").isalpha() and not values.is_file(text)]
            if words and len(value) > 1:
                raise OptionError(f"{flag} takes one choice, got {value[0]} and {value[1]}")
            return words[0] if words else values.read_vertex_map(flag, kind.noun, value)
        case declared.Edges():
            return _edges(flag, kind, value)
        case declared.Weights() | Sizes():
            return values.read_numbers("sizes" if isinstance(kind, Sizes) else "weights", value)
    return value


def _edges(flag: str, kind: declared.Edges, texts: Sequence[str]) -> Any:
    import numpy as np

    words = [text for text in texts if text in kind.words]
    files = [text for text in texts if text not in kind.words]
    if len(words) > 1:
        raise OptionError(f"{flag} {words[0]} is given twice")
    pairs = np.concatenate([values.read_pairs(text) for text in files]) if files else None
    if words and pairs is not None:
        return words[0], pairs
    return words[0] if words else pairs


def check_combinations(context: click.Context) -> None:
    """Raise an error if an option would have no effect."""
    params = context.params
    cones = params["cones"][0] if params["cones"] else "auto"
    method = params["method"] or "exact"
    declared_options = declarations(Options)
    search = [name for name in declarations(ConeOptions) if name != "cones"]
    of_method = [*search, "cones", *declarations(MetricOptions)]
    only = {
        choice: [name for name in declared_options if declared_options[name].only == choice]
        for choice in ("sparse", "exact")
    }
    are_given = cones not in declared.CONES
    rules = [
        (params["paper"], of_method, "--paper fixes the method"),
        (are_given, search, "there is no search if the cones are given"),
        (cones == "none", search, "there is no search with --cones none"),
        (cones == "greedy", only["sparse"], "--cones greedy does not take this option"),
        (params["cone_count"] is not None, ("distortion", "max_cones"), "--cone-count is given"),
        (method != "exact", only["exact"], f"--method {method} does not take this option"),
    ]
    refuse(context, rules)


def refuse(context: click.Context, rules: Iterable[tuple[Any, Iterable[str], str]]) -> None:
    """Raise an error if an option is given that a rule excludes; rules: (applies, names of options, reason)."""
    for applies, names, reason in rules:
        for name in names if applies else ():
            if is_given(context, name):
                raise click.UsageError(f"{reason}: leave out {flag_name(name)}", context)


def is_given(context: click.Context, name: str) -> bool:
    """Return whether an option is given on the command line."""
    return context.get_parameter_source(name) is ParameterSource.COMMANDLINE
