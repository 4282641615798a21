"""The flags of the commands, created from the declarations of the options; those that commands share; their help."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

import click
from click.core import ParameterSource

from ... import PAPER
from ... import options as declared
from ...base import Use, endings, with_formats
from ...errors import OptionError
from ...options import (
    MAX_SHOWN_TRIANGLES,
    RARE,
    ConeOptions,
    Declaration,
    Kind,
    MetricOptions,
    Number,
    Options,
    declarations,
    option,
    parse_angle,
    read_edges,
    read_numbers,
    read_vertices,
    read_vertices_or_pairs,
    read_word_or_vertex_map,
)
from ...quadmesh import Sizes

if TYPE_CHECKING:
    from ...measures import Requirement

Command = TypeVar("Command", bound=Callable[..., Any])
G = TypeVar("G")

#: Names of the options that `input_options` adds.
INPUT_NAMES = ("repair", "strict")
#: Words of a choice that the help lists in place of a value; of more, it lists them in the description.
MAX_LISTED_WORDS = 5
#: Formats of flattened meshes, as flags name them.
FORMAT_CHOICE = click.Choice([ending.removeprefix(".") for ending in endings(Use.FLATTENING)])
#: Further spellings of options.
SPELLINGS = {"quantise": ("--quantize",), "quads": ("--faces",), "output": ("-o",)}


class ExitCode(IntEnum):
    """Exit codes of the commands."""

    INTERNAL_ERROR = 1
    USER_ERROR = 2
    NOT_MET = 3  # a condition of --require
    SIGNALLED = 128  # to which the number of the signal is added, as shells do


#: Options of which the help shows only the first sentence of the description.
BRIEF = (*RARE, "distortion", "cone_count", "stretch", "seams", "sharp_angle", "resolution", "up")
RARE_TITLE = "Less common options (all details: docs/reference/command-line.md)"
#: Titles of groups of options in the help.
GROUPS = ("Texture", "Quads", "Pattern", "Cones", "Metric", "Seams", "Atlas", "Input", "Output", RARE_TITLE)


class Grouped(click.Option):
    """An option that the help lists under the title of a group."""

    def __init__(self, *args: Any, group: str, **options: Any) -> None:
        super().__init__(*args, **options)
        self.group = group


class GroupedCommand(click.Command):
    """A command whose help lists its options in groups; options without a group are listed under Output."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options, group by group."""
        groups: dict[str, list[tuple[str, str]]] = {title: [] for title in GROUPS}
        for param in self.get_params(ctx):
            record = param.get_help_record(ctx) if isinstance(param, click.Option) else None
            if record is not None:
                groups[getattr(param, "group", "Output")].append(record)
        for title, records in groups.items():
            if records:
                with formatter.section(title):
                    formatter.write_dl(records, col_max=24)


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


def names_formats(command: Command) -> Command:
    """Replace {MESH} and the names of other uses in the help of a command by the endings of files; see `Use`."""
    command.__doc__ = with_formats(command.__doc__ or "")
    return command


def _angle(value: Any) -> float:
    """Return an angle in radians from 1.57, pi/2, 0.1pi, 90deg, inf, or none, which is inf."""
    try:
        return math.inf if value.strip().lower() in ("inf", "none") else parse_angle(value)
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
            return {"type": _angle, "metavar": "ANGLE"}
        case Number(is_strength=True):
            return {"type": _strength, "is_flag": False, "flag_value": 1.0, "metavar": "STRENGTH"}
        case Number():
            return {"type": int if kind.is_integer else float}
        case declared.Direction():
            return {"type": _direction, "metavar": "DIRECTION"}
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


paper_option = click.option(
    "--paper",
    cls=Grouped,
    group="Metric",
    is_flag=True,
    help="The published method (Ben-Chen et al. 2008), one chart per component.",
)


up_option = click.option(
    "--up",
    type=click.Choice(["auto", "x", "y", "z"]),
    default="auto",
    show_default=True,
    help="Upward axis of the model in pictures: by default that of its format, or of its shape.",
)

_INPUT = (
    click.option(
        "--repair/--strict",
        "repair",
        cls=Grouped,
        group=RARE_TITLE,
        default=True,
        help="Repair a mesh that is not manifold, with a note; or reject it, and triangles without area, too.  "
        "[default: repair]",
    ),
    click.option(
        "--weld/--no-weld",
        cls=Grouped,
        group=RARE_TITLE,
        default=None,
        help="Merge all vertices at the same position, or none.  [default: all in STL and glTF; in other formats "
        "those on boundaries that coincide]",
    ),
)


def input_options(command: Command) -> Command:
    """Add the options `repair` and `weld` of meshes with defects to a command."""
    for add_option in reversed(_INPUT):
        command = add_option(command)
    return command


uv_set_option = click.option(
    "--uv-set",
    type=click.IntRange(0),
    default=0,
    show_default=True,
    help="Number of the UVs of a glTF: 1 for TEXCOORD_1, as of lightmaps.",
)

color_option = click.option(
    "--color",
    metavar="NAME|FILE",
    help="Your own values, shown as colours with a scale: the name of a vertex property of a .ply or of an array in a "
    "result (.npz); or FILE.npy, FILE.npz:NAME, or values of a brain such as lh.sulc, with one value per vertex or "
    "triangle.",
)

most_option = click.option(
    "--most-triangles",
    type=click.IntRange(1),
    default=MAX_SHOWN_TRIANGLES,
    show_default=True,
    help="Number of triangles to which a larger mesh is reduced, for display only.",
)

again_option = click.option(
    "--again", is_flag=True, help="Also flatten a mesh that has UVs, instead of showing these."
)


require_option = click.option(
    "--require",
    "required",
    metavar="MEASURE=VALUE",
    multiple=True,
    help=f"Exit with code {ExitCode.NOT_MET} if the report does not meet this condition; examples: flipped=0,overlap=0 "
    "and qc_mean<=1.05; also <, >, >=.",
)


QUIET, VERBOSE = "quiet", "verbose"


def verbosity_options(command: Command) -> Command:
    """Add -v and -q to a command, whose `verbosity` is then VERBOSE, QUIET or None; the last one given applies."""
    for short, long, value, meaning in (
        ("-q", "--quiet", QUIET, "Print errors only."),
        ("-v", "--verbose", VERBOSE, "Print each step, and all measures."),
    ):
        command = click.option(short, long, "verbosity", flag_value=value, default=None, help=meaning)(
            command
        )
    return command


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


def check_required(requirements: Iterable[Requirement], measures: dict[str, Any], written: str = "") -> None:
    """Print the requirements that failed, if any, and exit with code `ExitCode.NOT_MET`.

    written: name of the file that has been written anyway.
    """
    from ...measures import breaches

    lines = breaches(requirements, measures)
    if not lines:
        return
    for line in lines:
        click.echo(f"coneflat: requirement failed: {line}", err=True)
    if written:
        click.echo(f"coneflat: {written} is written anyway", err=True)
    raise click.exceptions.Exit(ExitCode.NOT_MET)
