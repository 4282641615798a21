"""`coneflat quads`."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ...options import QuadOptions, declarations, read_options
from ...options.declared import ConeBounds, ConeNumber
from .options import flag_of, is_given, keywords, option_flags
from .shared import checking, input_options, verbosity_options

if TYPE_CHECKING:
    from ...grid import IntegerGrid, QuadMeasures, QuadMesh
    from .console import Console


@click.command(short_help="Turn a mesh into quads.")
@click.argument("mesh", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    help="File of quads to write: .obj, .ply, .glb or .npz.  [default: MESH's name with _quads, as .obj; none if "
    "another file is named]",
)
@click.option(
    "--grid",
    type=click.Path(path_type=Path),
    help="File to write the integer grid to that quads are made of: .obj, with texture coordinates in squares of the "
    "grid, or .npz.",
)
@click.option(
    "--view",
    type=click.Path(path_type=Path),
    help="Page to write, .html, that shows the quads, their irregular vertices, and the rectangles that they form.",
)
@option_flags(QuadOptions, one_mesh=True)
@input_options
@click.option("--report", type=click.Path(path_type=Path), help="Write all measures to this JSON file.")
@verbosity_options
@click.pass_context
def quads(
    context: click.Context,
    /,
    mesh: Path,
    output: Path | None,
    grid: Path | None,
    view: Path | None,
    repair: bool,
    weld: bool | None,
    report: Path | None,
    verbosity: str | None,
    **method: Any,
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
    from ...files.atomic import check_target
    from ...files.grid import check_grid_output
    from ...files.quads import check_quads_output
    from ...view.page.webpage import check_page
    from .console import Console
    from .run import FLATTENED, require_distinct

    _check_combinations(context, mesh)
    options = keywords(method, QuadOptions)
    read_options(options, QuadOptions)
    if output is None and grid is None and view is None:
        output = Path(f"{mesh.stem}_quads.obj")
    # What can fail at the end is looked at before the work.
    files = {"output": output, "grid": grid, "view": view, "report": report}
    checks = (check_quads_output, check_grid_output, check_page, check_target)
    for path, check in zip(files.values(), checks, strict=True):
        if path is not None:
            check(path)
    require_distinct({"input": mesh, **files})
    rounds = {"smooth": options.pop("smooth")} if "smooth" in options else {}
    with Console(verbosity) as console:
        whole = _grid_of(mesh, console, {**options, **checking(repair)}, weld)
        found = None if output is None and view is None else _quads_of(whole, console, rounds)
        measures = None
        if found is not None:
            with console.stage("measure", FLATTENED):
                measures = _measured(found)
        with console.stage("write", FLATTENED):
            if grid is not None:
                whole.save(grid)
            if found is not None and output is not None:
                found.save(output)
            if found is not None and view is not None:
                _write_page(found, view, mesh.name)
        told = list((whole if found is None else found).notes)
        if report is not None:
            _write_report(report, whole, measures, told, console.seconds)
        console.say(f"note: {note}" for note in told)
        console.finish([path for path in files.values() if path is not None])
        console.table([*_grid_rows(whole), *(() if measures is None else measures.rows())])


def _check_combinations(context: click.Context, mesh: Path) -> None:
    """Refuse options that would have no effect."""
    if sum(is_given(context, name) for name in ("quads", "size", "coarsest")) > 1:
        raise click.UsageError("--quads (--faces), --size and --coarsest say the same: give one", context)
    searched = [*declarations(ConeBounds), *declarations(ConeNumber), "max_cones"]
    rules = [
        (is_given(context, "cone_count"), ["distortion", "max_cones"], "the number of cones is given"),
        (
            context.params["cones"] not in ((), ("auto",)),
            searched,
            "with cones given there is nothing to search",
        ),
    ]
    for applies, names, reason in rules:
        for name in names if applies else ():
            if is_given(context, name):
                raise click.UsageError(f"{reason}: leave out {flag_of(name)}", context)
    if mesh.suffix.lower() != ".npz":
        return
    for parameter in context.command.params:
        kept = ("mesh", "output", "grid", "view", "smooth", "report", "verbosity")
        if parameter.name not in kept and parameter.name is not None and is_given(context, parameter.name):
            raise click.UsageError(f"{mesh} is a grid: leave out {parameter.opts[0]}", context)


def _grid_of(mesh: Path, console: Console, options: dict[str, Any], weld: bool | None) -> IntegerGrid:
    """Return the grid of a mesh file, with notes on reading it, or the grid that a file holds."""
    from ...files.grid import read_grid
    from ...files.read import read_joined
    from ...grid import integer_grid
    from .run import FLATTENED, READ

    with console.stage("read", 0.0):
        if mesh.suffix.lower() == ".npz":
            return read_grid(mesh)
        joined = read_joined(mesh, weld)
    found = integer_grid(joined.mesh, progress=console.part(READ, FLATTENED), **joined.renamed(options))
    console.seconds.update(found.seconds)
    return replace(found, notes=joined.notes_of(found.notes))


def _quads_of(grid: IntegerGrid, console: Console, rounds: dict[str, Any]) -> QuadMesh:
    """Return the quads of a grid."""
    from ...grid.quads import quads as find_quads
    from .run import FLATTENED, READ

    found = find_quads(grid, progress=console.part(READ, FLATTENED), **rounds)
    console.seconds.update(found.seconds)
    return found


def _measured(found: QuadMesh) -> QuadMeasures:
    from ...grid import measure_quads

    return measure_quads(found)


def _write_page(found: QuadMesh, path: Path, name: str) -> None:
    from ...view.page.quads import page_of_quads
    from ...view.page.webpage import write_page

    write_page(page_of_quads(found, name=name), path)


def _write_report(
    path: Path, grid: IntegerGrid, measures: QuadMeasures | None, notes: list[str], seconds: dict[str, float]
) -> None:
    from ...files.atomic import atomic_write

    told = {
        **({} if measures is None else measures.report()),
        "grid": grid.report(),
        "seconds": dict(seconds),
        "notes": notes,
    }
    with atomic_write(path, "w") as file:
        json.dump(told, file, indent=2)
        file.write("\n")


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
