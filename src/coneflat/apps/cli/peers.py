"""`coneflat compare` and `coneflat paper`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from ... import PAPER
from ...options import FindOptions, declarations
from .options import flag, is_given, keywords, option_flags, parse_eye, path_flag, pop_flags, refuse
from .shared import GroupedCommand, input_options, up_option, verbosity_options

#: Files that `compare` writes.
COMPARED = ("compare.md", "compare.csv", "layouts.png", "quality.png")


@dataclass(frozen=True, kw_only=True)
class SightFlags:
    """Output.

    Attributes:
        eye: Direction from which pictures show the model: front, back, left, right, top, bottom, two of these, or
            X,Y,Z.
    """

    eye: Any = flag("front-right", type=parse_eye, metavar="EYE")


@dataclass(frozen=True, kw_only=True)
class CompareFlags(SightFlags):
    """Output.

    Attributes:
        output: Folder for the table (Markdown and CSV) and the pictures.  [default: none; the table is printed]
        methods: Methods to compare, separated by commas.  [default: all whose name contains no /]
        no_peers: Leave out other packages (libigl, xatlas, uvunwrap).
        paper: Use the cones of the published method (greedy, epsilon 1).
    """

    output: Path | None = path_flag()
    methods: str | None = flag(metavar="NAMES")
    no_peers: bool = flag(False, is_flag=True)
    paper: bool = flag(False, is_flag=True)


@dataclass(frozen=True, kw_only=True)
class PaperFlags(SightFlags):
    """Output.

    Attributes:
        output: Folder for the tables (Markdown and CSV) and the figures.
    """

    output: Path = path_flag(default=Path("paper"))


@click.command(cls=GroupedCommand, short_help="Compare all methods on a mesh, with the same cones and cut.")
@click.argument("mesh", type=click.Path(path_type=Path))
@option_flags(FindOptions)
@option_flags(CompareFlags)
@up_option
@input_options
@verbosity_options
@click.pass_context
def compare(
    context: click.Context, /, mesh: Path, up: str, weld: bool | None, verbosity: str | None, **given: Any
) -> None:
    """Flatten MESH by all methods, and by other packages that are installed, and compare the results.

    \b
    Examples:
      coneflat compare bunny.obj
      coneflat compare horse.ply --up z -o horse --methods exact,linear,bff,lscm
    """
    from ...errors import MetricError
    from ...io import read_joined
    from ..peers.run import COMPARED as METHODS
    from ..peers.run import compare_methods, comparison_csv, comparison_lines, comparison_markdown
    from .run import FLATTENED, READ, Console

    flags = pop_flags(given, CompareFlags)
    refuse(context, [(flags.paper, declarations(FindOptions), "--paper fixes the cones")])
    for name in ("eye", "up") if flags.output is None else ():
        if is_given(context, name):
            raise click.UsageError(f"--{name} is for pictures: add -o, or leave out --{name}", context)
    options = {**keywords(given, FindOptions), **(PAPER if flags.paper else {})}
    methods = METHODS if flags.methods is None else tuple(name.strip() for name in flags.methods.split(","))
    if flags.output is not None:
        from ..peers.pictures import Sight, draw_layouts, draw_qualities, open_folder, write_folder

        sight = Sight(flags.eye, up)
    with Console(verbosity) as console:
        with console.stage("read", 0.0):
            source = read_joined(mesh, weld)
        if flags.output is not None:
            open_folder(flags.output, COMPARED)
        with console.stage("compare", READ):
            found = compare_methods(
                source.mesh,
                methods=methods,
                peers=() if flags.no_peers else None,
                progress=console.part(READ, FLATTENED),
                **source.map_options(options),
            )
        console.say(f"note: {note}" for note in source.notes())
        if not found.drawn:
            why = "; ".join(f"{entry.method}: {entry.note}" for entry in found.entries)
            raise MetricError(f"no method found a layout: {why}")
        written: list[Path] = []
        if flags.output is not None:
            with console.stage("draw", FLATTENED):
                texts = comparison_markdown(found), comparison_csv(found)
                pictures = draw_layouts(found), draw_qualities(found, sight)
                written = write_folder(flags.output, dict(zip(COMPARED, (*texts, *pictures), strict=True)))
        console.say(comparison_lines(found))
        console.finish(written)


@click.command(short_help="Reproduce the paper's tables and figures.")
@click.argument("meshes", nargs=-1, required=True, type=click.Path(path_type=Path))
@option_flags(PaperFlags)
@up_option
@verbosity_options
def paper(meshes: tuple[Path, ...], up: str, verbosity: str | None, **given: Any) -> None:
    """Run the experiments of the paper (Section 5) on MESHES, and print its numbers next to those of coneflat.

    MESHES are files or folders. Models are recognised by their names: fandisk, rocker-arm, foot, gargoyle, elephant,
    horse, hand, torso, isi-horse.

    \b
    Examples:
      coneflat paper fandisk.obj rocker-arm.obj -o paper
      coneflat paper models
    """
    from ...io import find_meshes
    from ..peers import reproduce
    from ..peers.paper import FILES
    from ..peers.pictures import Sight, open_folder, write_folder
    from .run import FLATTENED, Console

    flags = pop_flags(given, PaperFlags)
    sight = Sight(flags.eye, up)
    for mesh in meshes:
        find_meshes(str(mesh))
    open_folder(flags.output, FILES)
    with Console(verbosity) as console:
        with console.stage("compare", 0.0):
            found = reproduce(meshes, progress=console.part(0.0, FLATTENED))
        with console.stage("draw", FLATTENED):
            written = write_folder(flags.output, {**found.texts(), **found.figures(sight)})
        console.say([found.tables().rstrip()])
        console.finish(written)
