"""`coneflat quads`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ...options import ConeBounds, ConeNumber, declarations, read_options
from ...quadmesh import QuadOptions
from .checks import check_required, is_given, refuse
from .flags import keywords, option_flags, path_flag, pop_flags
from .grouped_help import GroupedCommand, names_formats
from .shared_flags import input_options, require_option, verbosity_options

if TYPE_CHECKING:
    from ... import IntegerGrid, QuadMesh
    from ...io import Joined


@dataclass(frozen=True, kw_only=True)
class QuadFlags:
    """Output.

    Attributes:
        output: File for the quads: {QUADS}; by meshio {MESHIO}.  [default: MESH's name
            with _quads, as .obj; none if --grid or --view is given]
        grid: File for the integer grid that the quads are extracted from: .obj, with texture coordinates in units of
            grid squares, or .npz.
        view: Page (.html) that shows the quads, their irregular vertices, and the rectangles that they form.
        report: JSON file for all measures.
    """

    output: Path | None = path_flag()
    grid: Path | None = path_flag()
    view: Path | None = path_flag()
    report: Path | None = path_flag()


@click.command(cls=GroupedCommand, short_help="Convert a mesh to a quad mesh.")
@click.argument("mesh", type=click.Path(path_type=Path))
@option_flags(QuadOptions)
@option_flags(QuadFlags)
@input_options
@require_option
@verbosity_options
@click.pass_context
@names_formats
def quads(
    context: click.Context,
    /,
    mesh: Path,
    weld: bool | None,
    required: tuple[str, ...],
    verbosity: str | None,
    **params: Any,
) -> None:
    """Convert MESH to a mesh of quads only, with few irregular vertices.

    MESH is a file ({MESH}), or an integer grid (.npz) that --grid has
    written.

    \b
    Examples:
      coneflat quads horse.ply -o horse_quads.obj
      coneflat quads hand.obj --quads 3000 --stretch 0.5
      coneflat quads sheet.obj --boundary straight -o sheet_quads.glb
      coneflat quads bunny.obj --grid bunny_grid.obj
      coneflat quads hand.obj -o hand.npz --view hand.html
      coneflat quads hand.obj --require inverted=0 --require "quads<=12000"
    """
    from ... import integer_grid, measure_quads
    from ... import quads as find_quads
    from ...io import read_joined
    from ...measures import parse_requirements
    from ...quadmesh import QUAD_MEASURES, read_grid
    from .run import Console, require_distinct, write_report

    _check_combinations(context, mesh)
    flags, options = pop_flags(params, QuadFlags), _options(params)
    if flags.output is None and flags.grid is None and flags.view is None:
        flags = replace(flags, output=Path(f"{mesh.stem}_quads.obj"))
    files = _checked_files(flags)
    requirements = parse_requirements(required, QUAD_MEASURES)
    require_distinct({"input": mesh, **files})
    rounds = {"smooth": options.pop("smooth")} if "smooth" in options else {}
    with Console(verbosity) as console:
        with console.stage("read", 0.0):
            joined = None if mesh.suffix.lower() == ".npz" else read_joined(mesh, weld)
            source: Any = read_grid(mesh) if joined is None else joined.mesh
        options = {**({} if joined is None else joined.map_options(options)), "progress": console.part()}
        quad_mesh = measures = None
        if flags.output is None and flags.view is None and not requirements:
            done = grid_map = source if joined is None else integer_grid(source, **options)
        else:
            done = quad_mesh = find_quads(source, **options, **rounds)
            grid_map = quad_mesh.grid
            with console.stage("measure"):
                measures = measure_quads(quad_mesh)
        console.seconds.update(done.seconds)
        with console.stage("write"):
            _write(flags, grid_map, quad_mesh, mesh.name)
        notes = [*(done.notes if joined is None else joined.all_notes(done.notes)), *_left_out(flags, joined)]
        if flags.report is not None:
            measured = {} if measures is None else measures.report()
            run = {"grid": {"size": grid_map.size}, "seconds": dict(console.seconds), "notes": notes}
            write_report(flags.report, {**measured, **run})
        console.notes(notes)
        console.finish([path for path in files.values() if path is not None])
        square = "square", f"{grid_map.size:.4g}", "side of a grid square in model units"
        console.table([square, *(() if measures is None else measures.rows())])
    written = next((path for path in files.values() if path is not None), "")
    check_required(requirements, {} if measures is None else measures.report(), str(written))


def _options(params: dict[str, Any]) -> dict[str, Any]:
    """Return the checked options of the quads."""
    options = keywords(params, QuadOptions)
    read_options(options, QuadOptions)
    if "quads" in options and isinstance(options.get("size"), float):
        raise click.UsageError("--quads (--faces) and a length as --size exclude each other: leave out one")
    return options


def _checked_files(flags: QuadFlags) -> dict[str, Path | None]:
    """Return the files to write by role; errors that writing would raise are reported before the work starts."""
    from ...io import check_target
    from ...quadmesh import check_grid_output, check_quads_output
    from ..view import check_page

    files = {"output": flags.output, "grid": flags.grid, "view": flags.view, "report": flags.report}
    checks = (check_quads_output, check_grid_output, check_page, check_target)
    for path, check in zip(files.values(), checks, strict=True):
        if path is not None:
            check(path)
    return files


def _write(flags: QuadFlags, grid_map: IntegerGrid, quad_mesh: QuadMesh | None, name: str) -> None:
    """Write the grid, the quads and their page, of a mesh with a name, as far as they are requested."""
    from ..view import page_of_quads, write_page

    if flags.grid is not None:
        grid_map.save(flags.grid)
    if quad_mesh is not None and flags.output is not None:
        quad_mesh.save(flags.output)
    if quad_mesh is not None and flags.view is not None:
        write_page(page_of_quads(quad_mesh, name=name), flags.view)


def _left_out(flags: QuadFlags, joined: Joined | None) -> list[str]:
    """Return the notes on data of a mesh file that the written files do not keep."""
    from ...quadmesh import quads_left_out

    endings = [path.suffix.lower() for path in (flags.output, flags.grid) if path is not None]
    source = None if joined is None else joined.mesh
    return [note for ending in dict.fromkeys(endings) for note in quads_left_out(source, ending)]


def _check_combinations(context: click.Context, mesh: Path) -> None:
    """Raise an error if an option would have no effect."""
    searched = [*declarations(ConeBounds), *declarations(ConeNumber), "max_cones"]
    are_given = context.params["cones"] not in ((), ("auto",), ("sparse",))
    refuse(
        context,
        [
            (is_given(context, "cone_count"), ["distortion", "max_cones"], "--cone-count is given"),
            (are_given, searched, "there is no search if the cones are given"),
        ],
    )
    if mesh.suffix.lower() != ".npz":
        return
    for parameter in context.command.params:
        allowed = ("mesh", "output", "grid", "view", "smooth", "report", "required", "verbosity")
        if parameter.name not in allowed and parameter.name is not None and is_given(context, parameter.name):
            raise click.UsageError(f"{mesh} is a grid: leave out {parameter.opts[0]}", context)
