"""Flags that several commands have, which are no options of the method."""

from __future__ import annotations

import click

from ...base import Use, endings
from ...options import MAX_SHOWN_TRIANGLES
from .checks import ExitCode
from .grouped_help import RARE_TITLE, Command, Grouped

#: Formats of flattened meshes, as flags name them.
FORMAT_CHOICE = click.Choice([ending.removeprefix(".") for ending in endings(Use.FLATTENING)])


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
