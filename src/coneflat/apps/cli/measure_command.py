"""`coneflat measure`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .checks import check_required
from .grouped_help import names_formats
from .shared_flags import QUIET, input_options, require_option, uv_set_option, verbosity_options

if TYPE_CHECKING:
    from ...measures import Row
    from ..brains import FlatMeasures
    from ..uv_measures import UVMeasures


@click.command(short_help="Measure the UVs of a file, made by any tool.")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--report", type=click.Path(path_type=Path), help="JSON file for all measures.")
@click.option("--json", "as_json", is_flag=True, help="Print all measures as JSON instead of a table.")
@click.option("--surface", type=click.Path(path_type=Path), help="Brain surface of which FILE is a flat map.")
@uv_set_option
@require_option
@input_options
@verbosity_options
@names_formats
def measure(
    file: Path,
    surface: Path | None,
    report: Path | None,
    as_json: bool,
    uv_set: int,
    required: tuple[str, ...],
    repair: bool,
    weld: bool | None,
    verbosity: str | None,
) -> None:
    """Measure the UVs of FILE: a mesh with UVs ({UV}) of any program, or a result (.npz).

    \b
    Examples:
      coneflat measure horse_uv.obj
      coneflat measure asset.glb --json
      coneflat measure lightmapped.glb --uv-set 1
      coneflat measure asset.glb --require flipped=0,overlap=0 --require "qc_mean<=1.1"
    """
    from ...io import as_uv_mesh, check_target
    from ...measures import parse_requirements
    from ..brains import FLAT_MEASURES, measure_flat, read_flat
    from ..uv_measures import MEASURED, measure_mapped
    from .run import Console, require_distinct, write_report

    if surface is not None and weld:
        raise click.UsageError("--weld would change the numbers that --surface and FILE share: leave it out")
    if surface is not None and uv_set:
        raise click.UsageError("--uv-set has no effect with --surface: leave out one of them")
    requirements = parse_requirements(required, MEASURED if surface is None else (*MEASURED, *FLAT_MEASURES))
    if report is not None:
        check_target(report)
    require_distinct({"input": file, "report": report})
    with Console(verbosity) as console:
        with console.stage("read", 0.0):
            mapped = (
                as_uv_mesh(file, weld=weld, uv_set=uv_set) if surface is None else read_flat(file, surface)
            )
        with console.stage("measure", 0.3):
            flat = None if surface is None else measure_flat(mapped, strict=not repair)
            measured = measure_mapped(mapped, strict=not repair) if flat is None else flat.uv
        measures = (flat or measured).report()
        if report is not None:
            write_report(report, measures)
        if as_json and verbosity != QUIET:
            click.echo(json.dumps(measures, indent=2))
        elif not as_json:
            console.notes(measured.notes)
            console.table(rows_of_measures(measured, flat))
            console.finish([] if report is None else [report])
    check_required(requirements, measures)


def rows_of_measures(measured: UVMeasures, flat: FlatMeasures | None = None) -> list[Row]:
    """Return the rows (name, value, meaning) of the table of measures of UVs, or of a flat map of a brain."""
    from ...measures import FIRST_ROWS, map_rows, number_text, packing_row

    counts, of_map = measured.counts, map_rows(measured.distortion)
    missing = ""
    if counts["triangles_without_uv"]:
        missing = f"; {counts['triangles_without_uv']:,} without UVs"
    tiles = "" if counts["tiles"] == 1 else f" of {counts['tiles']:,} unit squares with charts"
    rows = [
        ("triangles", f"{counts['triangles']:,}", f"of {counts['polygons']:,} polygons as fans{missing}"),
        *(of_map.pop(name) for name in FIRST_ROWS if name in of_map),
        *(of_map.pop(name) for name in ("area distortion", "degenerate")),
        packing_row(counts["packing_efficiency"], tiles),
        ("outside", f"{counts['outside']:,}", "triangles that are not inside the unit square"),
        *of_map.values(),
        (
            "angle error",
            number_text(counts["angle_sum_error"], ".1e"),
            "largest angle error around a point inside a chart, radians",
        ),
    ]
    # Flat maps are in the unit of the surface, not in the unit square.
    is_texture = {"packing", "outside", "texel density"}
    return rows if flat is None else [*flat.rows(), *(row for row in rows if row[0] not in is_texture)]
