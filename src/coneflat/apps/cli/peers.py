"""`coneflat compare`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from ... import PAPER
from ...options import FindOptions, declarations
from .flags import (
    GroupedCommand,
    flag,
    input_options,
    is_given,
    keywords,
    option_flags,
    parse_eye,
    path_flag,
    pop_flags,
    refuse,
    up_option,
    verbosity_options,
)

#: Files that `compare` writes.
COMPARED = ("compare.md", "compare.csv", "layouts.png", "quality.png")


@dataclass(frozen=True, kw_only=True)
class CompareFlags:
    """Output.

    Attributes:
        output: Folder for the table (Markdown and CSV) and the pictures.  [default: none; the table is printed]
        methods: Methods to compare, separated by commas.  [default: all]
        eye: Direction from which pictures show the model: front, back, left, right, top, bottom, two of these, or
            X,Y,Z.
        no_peers: Leave out `unwrap` and other packages (xatlas, uvunwrap).
        paper: Use the cones of the published method (greedy, epsilon 1).
    """

    output: Path | None = path_flag()
    methods: str | None = flag(metavar="NAMES")
    eye: Any = flag("front-right", type=parse_eye, metavar="EYE")
    no_peers: bool = flag(False, is_flag=True)
    paper: bool = flag(False, is_flag=True)


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
    """Flatten MESH by all methods, by `unwrap`, and by other packages that are installed, and compare the results.

    \b
    Examples:
      coneflat compare bunny.obj
      coneflat compare horse.ply --up z -o horse --methods exact,linear,bff,lscm
    """
    from ...errors import MetricError
    from ...io import read_joined
    from ..peers import METHODS, compare_methods
    from ..peers.run import comparison_csv, comparison_lines, comparison_markdown
    from .run import Console

    flags = pop_flags(given, CompareFlags)
    refuse(context, [(flags.paper, declarations(FindOptions), "--paper fixes the cones")])
    for name in ("eye", "up") if flags.output is None else ():
        if is_given(context, name):
            raise click.UsageError(f"--{name} has no effect without -o: add -o", context)
    options = {**keywords(given, FindOptions), **(PAPER if flags.paper else {})}
    methods = METHODS if flags.methods is None else tuple(name.strip() for name in flags.methods.split(","))
    with Console(verbosity) as console:
        with console.stage("read", 0.0):
            source = read_joined(mesh, weld)
        if flags.output is not None:
            from ..peers.pictures import DPI, draw_layouts, draw_qualities, open_folder, write_folder
            from ..view import Look

            look = Look(eyes=(flags.eye,), up=up, dpi=DPI)
            open_folder(flags.output, COMPARED)
        with console.stage("compare", console.READ):
            found = compare_methods(
                source.mesh,
                methods=methods,
                peers=() if flags.no_peers else None,
                progress=console.part(),
                **source.map_options(options),
            )
        console.say(f"note: {note}" for note in source.notes())
        if not found.drawn:
            why = "; ".join(f"{entry.method}: {entry.note}" for entry in found.entries)
            raise MetricError(f"no method found a layout: {why}")
        written: list[Path] = []
        if flags.output is not None:
            with console.stage("draw"):
                texts = comparison_markdown(found), comparison_csv(found)
                pictures = draw_layouts(found), draw_qualities(found, look)
                written = write_folder(flags.output, dict(zip(COMPARED, (*texts, *pictures), strict=True)))
        console.say(comparison_lines(found))
        console.finish(written)
