"""Options that several commands have."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from ...result.requirements import Requirement


Command = TypeVar("Command", bound=Callable[..., Any])

#: Exit code where what `--require` asks for is not met.
NOT_MET = 3


class Eye(click.ParamType):  # type: ignore[type-arg]
    """A direction: 1,0.5,2, or words such as front-right."""

    name = "eye"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return three numbers, or the words."""
        if not isinstance(value, str) or "," not in value:
            return value
        try:
            return tuple(float(number) for number in value.split(","))
        except ValueError:
            self.fail(f"{value!r} is no direction; write 1,0.5,2 or front-right", param, ctx)


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
        default=True,
        help="Repair what is no manifold (split edges and vertices, drop degenerate faces, cut one-sided surfaces), "
        "with a note; or refuse it, and triangles without area, too.  [default: repair]",
    ),
    click.option(
        "--weld/--no-weld",
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

again_option = click.option(
    "--again", is_flag=True, help="Flatten a mesh that has UVs, too, instead of showing these."
)


def checking(repair: bool) -> dict[str, bool]:
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
    from ...result.requirements import breaches

    lines = breaches(requirements, measures)
    if not lines:
        return
    for line in lines:
        click.echo(f"coneflat: not met: {line}", err=True)
    if written:
        click.echo(f"coneflat: {written} is written nevertheless", err=True)
    raise click.exceptions.Exit(NOT_MET)


def measures_alone(words: Sequence[str]) -> Sequence[str]:
    """Return what `--require` is given, unless it is a vertex, as it once could be."""
    for word in words:
        if word.strip().lstrip("+-").isdecimal():
            raise click.UsageError(
                f"--require takes measures, flipped=0 say; a vertex that is a cone in any case: --required-cones {word}"
            )
    return words


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
