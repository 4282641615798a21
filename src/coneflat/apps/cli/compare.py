"""`coneflat compare` and `coneflat paper`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ...options import PAPER, FindOptions
from .options import flag_of, is_given, keywords, option_flags
from .shared import Eye, checking, input_options, up_option, verbosity_options

#: What `compare` writes.
COMPARED = ("compare.md", "compare.csv", "layouts.png", "quality.png")

eye_option = click.option(
    "--eye",
    type=Eye(),
    metavar="EYE",
    default="front-right",
    show_default=True,
    help="Where to look from in pictures: front, back, left, right, top, bottom, two of them, or X,Y,Z.",
)


@click.command(short_help="Flatten a mesh by all methods, with the same cones and cut.")
@click.argument("mesh", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    help="Folder for the table (Markdown and CSV) and the pictures.  [default: the table is printed only]",
)
@click.option(
    "--methods",
    metavar="NAMES",
    help="Methods to compare, with commas: names that flatten --method takes.  [default: all without a /]",
)
@click.option("--no-peers", is_flag=True, help="Leave out other packages (libigl, xatlas, uvunwrap).")
@click.option("--paper", is_flag=True, help="The cones of the published method (greedy, epsilon 1).")
@option_flags(FindOptions, one_mesh=True)
@eye_option
@up_option
@input_options
@verbosity_options
@click.pass_context
def compare(
    context: click.Context,
    /,
    mesh: Path,
    output: Path | None,
    methods: str | None,
    no_peers: bool,
    paper: bool,
    eye: Any,
    up: str,
    repair: bool,
    weld: bool | None,
    verbosity: str | None,
    **search: Any,
) -> None:
    """Flatten MESH by all methods, and by other packages that are installed, and tell how they compare.

    \b
    Examples:
      coneflat compare bunny.obj
      coneflat compare horse.ply --up z -o horse --methods exact,linear,bff,lscm
    """
    from ...errors import MetricError
    from ...files.read import read_joined
    from ...options import METHODS
    from ..compare.run import compare_methods
    from ..compare.table import comparison_csv, comparison_lines, comparison_markdown
    from .console import Console
    from .run import FLATTENED, READ

    for name in search if paper else ():
        if is_given(context, name):
            raise click.UsageError(f"--paper says which cones: leave out {flag_of(name)}", context)
    for name in ("eye", "up") if output is None else ():
        if is_given(context, name):
            raise click.UsageError(f"pictures need a folder: give -o, or leave out --{name}", context)
    options = {**checking(repair), **(PAPER if paper else keywords(search, FindOptions))}
    chosen = METHODS if methods is None else tuple(name.strip() for name in methods.split(","))
    if output is not None:
        from ..compare.pictures import Sight, draw_layouts, draw_qualities
        from ..compare.write import open_folder, write_folder

        sight = Sight(eye, up)
    with Console(verbosity) as console:
        with console.stage("read", 0.0):
            source = read_joined(mesh, weld)
        if output is not None:
            open_folder(output, COMPARED)
        with console.stage("compare", READ):
            found = compare_methods(
                source.mesh,
                methods=chosen,
                peers=() if no_peers else None,
                progress=console.part(READ, FLATTENED),
                **source.renamed(options),
            )
        console.say(f"note: {note}" for note in source.notes())
        if not found.drawn:
            why = "; ".join(f"{entry.method}: {entry.note}" for entry in found.entries)
            raise MetricError(f"no method came to a layout: {why}")
        written: list[Path] = []
        if output is not None:
            with console.stage("draw", FLATTENED):
                texts = comparison_markdown(found), comparison_csv(found)
                pictures = draw_layouts(found), draw_qualities(found, sight)
                written = write_folder(output, dict(zip(COMPARED, (*texts, *pictures), strict=True)))
        console.say(comparison_lines(found))
        console.finish(written)


@click.command(short_help="Reproduce the paper's tables and figures.")
@click.argument("meshes", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    default=Path("paper"),
    show_default=True,
    help="Folder for tables (Markdown and CSV) and figures.",
)
@eye_option
@up_option
@verbosity_options
def paper(meshes: tuple[Path, ...], output: Path, eye: Any, up: str, verbosity: str | None) -> None:
    """Run the experiments of the paper (Section 5) on MESHES, files or folders, its numbers beside ours.

    Models are known by their names: fandisk, rocker-arm, foot, gargoyle, elephant, horse, hand, torso, isi-horse.

    \b
    Examples:
      coneflat paper fandisk.obj rocker-arm.obj -o paper
      coneflat paper models
    """
    from ...files.read import find_meshes
    from ..compare import reproduce
    from ..compare.paper import FILES
    from ..compare.pictures import Sight
    from ..compare.write import open_folder, write_folder
    from .console import Console
    from .run import FLATTENED

    sight = Sight(eye, up)
    for mesh in meshes:
        find_meshes(str(mesh))
    open_folder(output, FILES)
    with Console(verbosity) as console:
        with console.stage("compare", 0.0):
            found = reproduce(meshes, progress=console.part(0.0, FLATTENED))
        with console.stage("draw", FLATTENED):
            written = write_folder(output, {**found.texts(), **found.figures(sight)})
        console.say([found.tables().rstrip()])
        console.finish(written)
