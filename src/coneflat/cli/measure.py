"""`coneflat measure`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from .shared import check_required, input_options, require_option
from .talk import QUIET, talk_options


@click.command(short_help="Measure the UVs that a file has, of any tool.")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--report", type=click.Path(path_type=Path), help="Write all measures to this JSON file.")
@click.option("--json", "as_json", is_flag=True, help="Print all measures as JSON instead of a table.")
@require_option
@input_options
@talk_options
def measure(
    file: Path,
    report: Path | None,
    as_json: bool,
    required: tuple[str, ...],
    repair: bool,
    weld: bool | None,
    talk: str | None,
) -> None:
    """Measure the UVs of FILE: a mesh with UVs (.obj, .ply, .gltf, .glb), whatever wrote it, or a result (.npz).

    \b
    Examples:
      coneflat measure horse_uv.obj
      coneflat measure asset.glb --json
      coneflat measure asset.glb --require flipped=0,overlap=0 --require "qc_mean<=1.1"
    """
    from ..io.atomic import atomic_write, check_target
    from ..mapped import as_mapped
    from ..requirements import parse_requirements
    from ..uvs import MEASURED, measure_mapped
    from .console import Console
    from .run import require_distinct

    requirements = parse_requirements(required, MEASURED)
    if report is not None:
        check_target(report)
    require_distinct({"input": file, "report": report})
    with Console(talk) as console:
        with console.stage("read", 0.0):
            mapped = as_mapped(file, weld=weld)
        with console.stage("measure", 0.3):
            measured = measure_mapped(mapped, strict=not repair)
        found = measured.report()
        if report is not None:
            with atomic_write(report, "w") as stream:
                json.dump(found, stream, indent=2)
                stream.write("\n")
        if as_json and talk != QUIET:
            click.echo(json.dumps(found, indent=2))
        elif not as_json:
            console.say(f"note: {note}" for note in measured.notes)
            console.table(rows_of_measures(found))
            console.finish([] if report is None else [report])
    check_required(requirements, found)


def rows_of_measures(found: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Return (measure, value, meaning) rows of a report of UVs."""

    def number(name: str, form: str) -> str:
        return "unknown" if found[name] is None else format(found[name], form)

    missing = ""
    if found["triangles_without_uv"]:
        missing = f"; {found['triangles_without_uv']:,} without UVs"
    tiles = "" if found["tiles"] == 1 else f" of {found['tiles']:,} unit squares with charts"
    share = "unknown" if found["overlap"] is None else f"{100 * found['overlap']:.3g} %"
    overlaps = share if found["overlapping_pairs"] else "none"
    return [
        ("triangles", number("triangles", ",d"), f"of {found['polygons']:,} polygons, as fans{missing}"),
        ("charts", number("charts", ",d"), f"pieces of the layout; {found['mirrored_charts']:,} mirrored"),
        (
            "overlap",
            overlaps,
            f"of the area covered, covered twice; {found['overlapping_pairs']:,} pairs of triangles",
        ),
        ("flipped", number("flipped", ",d"), "triangles against the orientation of their chart"),
        (
            "texel density",
            number("density_spread", ".3f"),
            "its spread: the quantile at 95% over that at 5%",
        ),
        ("seam length", number("seam_length", ".3f"), "over the square root of the area"),
        (
            "QC distortion",
            number("qc_mean", ".4f"),
            f"1 is conformal; 95% below {number('qc_p95', '.4f')}, worst {number('qc_max', '.4g')}",
        ),
        ("area distortion", number("area_std", ".4f"), "standard deviation of the log of the scale, by area"),
        (
            "degenerate",
            number("degenerate", ",d"),
            f"without area in the plane; {found['degenerate_input']:,} have none on the model",
        ),
        ("packing", number("packing_efficiency", ".1%"), f"of the texture is covered{tiles}"),
        ("outside", number("outside", ",d"), "triangles that reach out of the unit square"),
        (
            "seam mismatch",
            number("seam_mismatch", ".1e"),
            f"of the two sides' lengths; worst {number('seam_mismatch_max', '.1e')}",
        ),
        (
            "angle error",
            number("angle_sum_error", ".1e"),
            "radians missing around points inside charts, the most",
        ),
    ]
