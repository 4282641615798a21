"""Options that several commands share, and the layout of the help."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from enum import IntEnum
from typing import TYPE_CHECKING, Any, TypeVar

import click

from ...options import MAX_SHOWN_TRIANGLES, RARE

if TYPE_CHECKING:
    from ...measures import Requirement


Command = TypeVar("Command", bound=Callable[..., Any])

#: Options of which the help shows only the first sentence of the description.
BRIEF = (*RARE, "distortion", "cone_count", "stretch", "seams", "sharp_angle", "resolution", "up")
RARE_TITLE = "Less common options (all details: docs/reference/command-line.md)"
#: Titles of groups of options in the help.
GROUPS = ("Texture", "Quads", "Cones", "Metric", "Seams", "Atlas", "Input", "Output", RARE_TITLE)


class ExitCode(IntEnum):
    """Exit codes of the commands."""

    INTERNAL_ERROR = 1
    USER_ERROR = 2
    NOT_MET = 3  # a condition of --require
    SIGNALLED = 128  # to which the number of the signal is added, as shells do


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


up_option = click.option(
    "--up",
    type=click.Choice(["x", "y", "z"]),
    default="y",
    show_default=True,
    help="Upward axis of the model in pictures.",
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
    for option in reversed(_INPUT):
        command = option(command)
    return command


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


def repair_keywords(repair: bool) -> dict[str, Any]:
    """Return the keyword arguments of `coneflat.flatten` for `--repair` or `--strict`."""
    return {"repair": repair, "strict": not repair}


require_option = click.option(
    "--require",
    "required",
    metavar="MEASURE=VALUE",
    multiple=True,
    help=f"Exit with code {ExitCode.NOT_MET} if the report does not meet this condition; examples: flipped=0,overlap=0 "
    "and qc_mean<=1.05; also <, >, >=.",
)


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
