"""`coneflat quads`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ...options import ConeBounds, ConeNumber, declarations, read_options
from ..quads.options import QuadOptions
from .options import chosen, is_given, keywords, option_flags, path_flag, refuse
from .shared import GroupedCommand, input_options, verbosity_options

if TYPE_CHECKING:
    from ... import IntegerGrid
    from .run import Console


@dataclass(frozen=True, kw_only=True)
class QuadFlags:
    """Output.

    Attributes:
        output: File of quads to write: .obj, .ply, .glb or .npz.  [default: MESH's name with _quads, as .obj; none if
            another file is named]
        grid: File to write the integer grid to that quads are made of: .obj, with texture coordinates in squares of the
            grid, or .npz.
        view: Page to write, .html, that shows the quads, their irregular vertices, and the rectangles that they form.
        report: Write all measures to this JSON file.
    """

    output: Path | None = path_flag()
    grid: Path | None = path_flag()
    view: Path | None = path_flag()
    report: Path | None = path_flag()


@click.command(cls=GroupedCommand, short_help="Turn a mesh into quads.")
@click.argument("mesh", type=click.Path(path_type=Path))
@option_flags(QuadOptions)
@option_flags(QuadFlags)
@input_options
@verbosity_options
@click.pass_context
def quads(
    context: click.Context, /, mesh: Path, weld: bool | None, verbosity: str | None, **given: Any
) -> None:
    """Turn MESH (.obj, .ply, .stl, .off, .gltf, .glb) into quads alone, with few irregular vertices.

    MESH may be a grid, too, as --grid writes it to .npz.

    \b
    Examples:
      coneflat quads horse.ply -o horse_quads.obj
      coneflat quads hand.obj --quads 3000 --stretch 0.5
      coneflat quads sheet.obj --boundary straight -o sheet_quads.glb
      coneflat quads bunny.obj --grid bunny_grid.obj
      coneflat quads hand.obj -o hand.npz --view hand.html
    """
    from ... import measure_quads
    from ... import quads as find_quads
    from ...io import check_target
    from ..quads.files import check_grid_output, check_quads_output
    from ..quads.page import page_of_quads
    from ..view import check_page, write_page
    from .run import FLATTENED, READ, Console, require_distinct, write_report

    _check_combinations(context, mesh)
    flags, options = chosen(given, QuadFlags), keywords(given, QuadOptions)
    read_options(options, QuadOptions)
    output, grid, view = flags.output, flags.grid, flags.view
    if output is None and grid is None and view is None:
        output = Path(f"{mesh.stem}_quads.obj")
    # What can fail at the end is looked at before the work.
    files = {"output": output, "grid": grid, "view": view, "report": flags.report}
    checks = (check_quads_output, check_grid_output, check_page, check_target)
    for path, check in zip(files.values(), checks, strict=True):
        if path is not None:
            check(path)
    require_distinct({"input": mesh, **files})
    rounds = {"smooth": options.pop("smooth")} if "smooth" in options else {}
    with Console(verbosity) as console:
        whole = _grid_of(mesh, console, options, weld)
        found = measures = None
        if output is not None or view is not None:
            found = find_quads(whole, progress=console.part(READ, FLATTENED), **rounds)
            console.seconds.update(found.seconds)
            with console.stage("measure", FLATTENED):
                measures = measure_quads(found)
        with console.stage("write", FLATTENED):
            if grid is not None:
                whole.save(grid)
            if found is not None and output is not None:
                found.save(output)
            if found is not None and view is not None:
                write_page(page_of_quads(found, name=mesh.name), view)
        told = list((whole if found is None else found).notes)
        if flags.report is not None:
            measured = {} if measures is None else measures.report()
            rest = {"grid": whole.report(), "seconds": dict(console.seconds), "notes": told}
            write_report(flags.report, {**measured, **rest})
        console.say(f"note: {note}" for note in told)
        console.finish([path for path in files.values() if path is not None])
        console.table([*_grid_rows(whole), *(() if measures is None else measures.rows())])


def _check_combinations(context: click.Context, mesh: Path) -> None:
    """Refuse options that would have no effect."""
    if is_given(context, "quads") and is_given(context, "size"):
        raise click.UsageError("--quads (--faces) and --size say the same: give one", context)
    searched = [*declarations(ConeBounds), *declarations(ConeNumber), "max_cones"]
    given = context.params["cones"] not in ((), ("auto",))
    refuse(
        context,
        [
            (is_given(context, "cone_count"), ["distortion", "max_cones"], "the number of cones is given"),
            (given, searched, "with cones given there is nothing to search"),
        ],
    )
    if mesh.suffix.lower() != ".npz":
        return
    for parameter in context.command.params:
        kept = ("mesh", "output", "grid", "view", "smooth", "report", "verbosity")
        if parameter.name not in kept and parameter.name is not None and is_given(context, parameter.name):
            raise click.UsageError(f"{mesh} is a grid: leave out {parameter.opts[0]}", context)


def _grid_of(mesh: Path, console: Console, options: dict[str, Any], weld: bool | None) -> IntegerGrid:
    """Return the grid of a mesh file, with notes on reading it, or the grid that a file holds."""
    from ... import integer_grid
    from ...io import read_joined
    from ..quads.files import read_grid
    from .run import FLATTENED, READ

    with console.stage("read", 0.0):
        if mesh.suffix.lower() == ".npz":
            return read_grid(mesh)
        joined = read_joined(mesh, weld)
    found = integer_grid(joined.mesh, progress=console.part(READ, FLATTENED), **joined.renamed(options))
    console.seconds.update(found.seconds)
    return replace(found, notes=joined.notes_of(found.notes))


def _grid_rows(grid: IntegerGrid) -> Iterator[tuple[str, str, str]]:
    """Yield what is printed of a grid: measure, value, meaning."""
    moved = f"; rounding moved cones by {grid.move_rms:.2f} squares, {grid.move_max:.2f} at most"
    yield (
        "square",
        f"{grid.size:.4g}",
        f"its side in model units{moved if math.isfinite(grid.move_rms) else ''}",
    )
    if math.isfinite(grid.qc_mean):
        yield (
            "grid QC",
            f"{grid.qc_mean:.4f}",
            f"mean distortion of the map; {grid.qc_before:.4f} before rounding",
        )
