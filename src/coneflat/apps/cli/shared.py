"""Options that several commands have."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, TypeVar

import click

from ...options import MOST_TRIANGLES

if TYPE_CHECKING:
    from ...measure import Requirement


Command = TypeVar("Command", bound=Callable[..., Any])

#: Titles of groups of flags in the help.
GROUPS = ("Quads", "Cones", "Metric", "Seams", "Atlas", "Input", "Output")
#: Exit code where what `--require` asks for is not met.
NOT_MET = 3


class Grouped(click.Option):
    """A flag that the help lists under the title of a group."""

    def __init__(self, *args: Any, group: str, **more: Any) -> None:
        super().__init__(*args, **more)
        self.group = group


class GroupedCommand(click.Command):
    """A command whose help lists its flags in groups; those without one are of the output."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the flags, group by group."""
        groups: dict[str, list[tuple[str, str]]] = {title: [] for title in GROUPS}
        for param in self.get_params(ctx):
            record = param.get_help_record(ctx) if isinstance(param, click.Option) else None
            if record is not None:
                groups[getattr(param, "group", GROUPS[-1])].append(record)
        for title, records in groups.items():
            if records:
                with formatter.section(title):
                    formatter.write_dl(records)


up_option = click.option(
    "--up",
    type=click.Choice(["x", "y", "z"]),
    default="y",
    show_default=True,
    help="The model's upward axis in pictures.",
)

_INPUT = (
    click.option(
        "--repair/--strict",
        "repair",
        cls=Grouped,
        group="Input",
        default=True,
        help="Repair what is not manifold (split edges and vertices, drop degenerate faces, cut one-sided surfaces), "
        "with a note; or refuse it, and triangles without area, too.  [default: repair]",
    ),
    click.option(
        "--weld/--no-weld",
        cls=Grouped,
        group="Input",
        default=None,
        help="Merge all vertices at the same position, or none.  [default: all in STL and glTF; in others those along "
        "borders that coincide]",
    ),
)


def input_options(command: Command) -> Command:
    """Add the options that say what to do with a mesh that is not quite one: `repair` and `weld`."""
    for option in reversed(_INPUT):
        command = option(command)
    return command


color_option = click.option(
    "--color",
    metavar="NAME|FILE",
    help="Numbers of your own, as colours with a scale: a property of the vertices of a .ply, an array of a result "
    ".npz, or FILE.npy, FILE.npz:NAME; one for each vertex or triangle.",
)

most_option = click.option(
    "--most-triangles",
    type=click.IntRange(1),
    default=MOST_TRIANGLES,
    show_default=True,
    help="Thin a larger mesh to so many, for display only.",
)

again_option = click.option(
    "--again", is_flag=True, help="Flatten a mesh that has UVs, too, instead of showing these."
)


def checking(repair: bool) -> dict[str, Any]:
    """Return what `--repair` or `--strict` mean as keyword arguments of `coneflat.flatten`."""
    return {"repair": repair, "strict": not repair}


require_option = click.option(
    "--require",
    "required",
    metavar="MEASURE=VALUE",
    multiple=True,
    help=f"Exit with code {NOT_MET} unless measures of the report are so: flipped=0,overlap=0 or qc_mean<=1.05; also "
    "<, >, >=.",
)


def check_required(requirements: Iterable[Requirement], measures: dict[str, Any], written: str = "") -> None:
    """Say which requirements measures do not meet, and end with the exit code for that.

    written: what has been written nevertheless.
    """
    from ...measure import breaches

    lines = breaches(requirements, measures)
    if not lines:
        return
    for line in lines:
        click.echo(f"coneflat: not met: {line}", err=True)
    if written:
        click.echo(f"coneflat: {written} is written nevertheless", err=True)
    raise click.exceptions.Exit(NOT_MET)


QUIET, VERBOSE = "quiet", "verbose"


def verbosity_options(command: Command) -> Command:
    """Add -v and -q, of which the last counts; the command's `verbosity` is VERBOSE, QUIET or None."""
    for short, long, value, meaning in (
        ("-q", "--quiet", QUIET, "Print nothing but errors."),
        ("-v", "--verbose", VERBOSE, "Print every step as it begins, and how the result was found."),
    ):
        command = click.option(short, long, "verbosity", flag_value=value, default=None, help=meaning)(
            command
        )
    return command
