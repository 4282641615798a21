"""The flags of the commands, created from the declarations of the options; and the options that they stand for."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, cast

import click

from ... import PAPER
from ... import options as declared
from ...base import with_formats
from ...options import (
    RARE,
    Declaration,
    Kind,
    Number,
    Options,
    declarations,
    option,
    read_edges,
    read_numbers,
    read_vertices,
    read_vertices_or_pairs,
    read_word_or_vertex_map,
)
from ...quadmesh import Sizes
from .flag_values import direction_parser, parse_angle_or_inf, parse_strength
from .grouped_help import BRIEF, RARE_TITLE, Command, Grouped

G = TypeVar("G")
#: Names of the options that `input_options` adds.
INPUT_NAMES = ("repair", "strict")
#: Words of a choice that the help lists in place of a value; of more, it lists them in the description.
MAX_LISTED_WORDS = 5
#: Further spellings of options.
SPELLINGS = {"quantise": ("--quantize",), "quads": ("--faces",), "output": ("-o",)}


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
    kind, name, doc = declaration.kind, declaration.name, with_formats(declaration.doc)
    spelling = flag_name(name)
    if declaration.default is True:
        spelling += f"/--no-{spelling[2:]}"
    if isinstance(kind, declared.Choice) and len(kind.words) > MAX_LISTED_WORDS:
        doc += f" One of {', '.join(kind.words)}."
    title = RARE_TITLE if name in RARE else declaration.group
    if name in BRIEF:
        doc = doc.split(". ")[0].rstrip(".") + "."
    default = shown_default(declaration)
    doc += f"  [default: {default}]" if default else ""
    names = (spelling, *SPELLINGS.get(name, ()), name)
    return click.option(*names, cls=Grouped, group=title, help=doc, **_click_arguments(kind))


def _click_arguments(kind: Kind) -> dict[str, Any]:
    """Return the arguments of `click.option` for the texts of a kind of options; `_value` returns what they mean."""
    match kind:
        case ClickKind():
            return dict(kind.arguments)
        case _ if kind.metavar:
            return {"metavar": kind.metavar}
        case declared.Flag():
            return {"is_flag": True, "default": None}
        case declared.Choice():
            metavar = {"metavar": "NAME"} if len(kind.words) > MAX_LISTED_WORDS else {}
            return {"type": click.Choice(kind.words), **metavar}
        case Number(is_angle=True):
            return {"type": parse_angle_or_inf, "metavar": "ANGLE"}
        case Number(is_strength=True):
            return {"type": parse_strength, "is_flag": False, "flag_value": 1.0, "metavar": "STRENGTH"}
        case Number():
            return {"type": int if kind.is_integer else float}
        case declared.Direction():
            return {
                "type": direction_parser(kind.words),
                "metavar": "|".join((*kind.words, "DIRECTION")),
            }
        case declared.Vertices() | declared.VerticesOrEdges():
            return {"multiple": True, "metavar": "VERTICES|FILE"}
        case declared.WordOrVertices():
            forms = (*kind.words, "VERTEX[:CURVATURE],...", "FILE")
            return {"multiple": True, "metavar": "|".join(forms)}
        case declared.Edges():
            return {"multiple": True, "metavar": "|".join((*kind.words, "FILE"))}
        case declared.Weights():
            return {"metavar": "NAME|FILE"}
    return {}


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


def repair_keywords(repair: bool) -> dict[str, Any]:
    """Return the keyword arguments of `coneflat.flatten` for `--repair` or `--strict`."""
    return {"repair": repair, "strict": not repair}


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
            return tuple(dict.fromkeys(v for text in value for v in read_vertices(flag, text)))
        case declared.VerticesOrEdges():
            return read_vertices_or_pairs(flag, value)
        case declared.WordOrVertices():
            return read_word_or_vertex_map(flag, kind.noun, value)
        case declared.Edges():
            return read_edges(flag, kind.words, value)
        case declared.Weights() | Sizes():
            return read_numbers("sizes" if isinstance(kind, Sizes) else "weights", value)
    return value
