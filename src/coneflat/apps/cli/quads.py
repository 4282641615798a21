"""`coneflat quads`."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .shared import checking, input_options, verbosity_options

if TYPE_CHECKING:
    from ...grid import QuadMeasures


@click.command(short_help="Turn a mesh into quads.")
@click.argument("mesh", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    help="File to write: .obj, .ply, .glb or .npz.  [default: MESH's name with _quads, as .obj]",
)
@click.option("--faces", type=int, help="About how many quads.  [default: 10000]")
@click.option("--size", type=float, help="Length of a quad's edges in model units, instead of --faces.")
@click.option(
    "--stretch",
    type=float,
    default=0.0,
    show_default=True,
    help="What quads are to be alike in, from 0, angles alone, to 1, sizes as well.",
)
@click.option(
    "--smooth",
    type=int,
    default=10,
    show_default=True,
    help="Rounds of smoothing on the surface; 0 for none.",
)
@input_options
@click.option("--report", type=click.Path(path_type=Path), help="Write all measures to this JSON file.")
@verbosity_options
@click.pass_context
def quads(
    context: click.Context,
    /,
    mesh: Path,
    output: Path | None,
    faces: int | None,
    size: float | None,
    stretch: float,
    smooth: int,
    repair: bool,
    weld: bool | None,
    report: Path | None,
    verbosity: str | None,
) -> None:
    """Turn MESH (.obj, .ply, .stl, .off, .gltf, .glb) into quads alone, with few irregular vertices.

    \b
    Examples:
      coneflat quads horse.ply -o horse_quads.obj
      coneflat quads hand.obj --faces 3000 --stretch 0.5
    """
    from ...files.atomic import atomic_write, check_target
    from ...files.quads import check_quads_output
    from ...files.read import read_joined
    from ...grid import measure_quads
    from ...grid.quads import quads as find_quads
    from .console import Console
    from .run import FLATTENED, READ, require_distinct

    if faces is not None and size is not None:
        raise click.UsageError("--faces and --size say the same: leave one out", context)
    output = Path(f"{mesh.stem}_quads.obj") if output is None else output
    check_quads_output(output)
    if report is not None:
        check_target(report)
    require_distinct({"input": mesh, "output": output, "report": report})
    with Console(verbosity) as console:
        with console.stage("read", 0.0):
            joined = read_joined(mesh, weld)
        with console.stage("quads", READ):
            found = find_quads(
                joined.mesh,
                quads=faces,
                size=size,
                stretch=stretch,
                smooth=smooth,
                progress=console.part(READ, FLATTENED),
                **checking(repair),
            )
        with console.stage("measure", FLATTENED):
            measures = measure_quads(found)
        with console.stage("write", FLATTENED):
            found.save(output)
            if report is not None:
                with atomic_write(report, "w") as file:
                    notes = list(joined.notes_of(found.notes))
                    json.dump({**measures.report(), "notes": notes}, file, indent=2)
                    file.write("\n")
        console.say(f"note: {note}" for note in joined.notes_of(found.notes))
        console.finish([path for path in (output, report) if path is not None])
        console.table(_rows(measures))


def _rows(measures: QuadMeasures) -> Iterator[tuple[str, str, str]]:
    """Yield what is printed: measure, value, meaning."""
    valences = ", ".join(f"{count:,} of {valence}" for valence, count in measures.irregular_valences.items())
    apart = measures.hausdorff / measures.edge_mean
    yield "quads", f"{measures.quads:,}", f"Euler characteristic {measures.euler_characteristic}"
    yield (
        "irregular",
        f"{measures.irregular:,}",
        f"inner vertices of other valence than 4: {valences or 'none'}",
    )
    yield (
        "off 90 deg",
        f"{measures.angle_mean:.2f}",
        f"mean; 95% below {measures.angle_p95:.1f}, worst {measures.angle_max:.1f}",
    )
    yield (
        "edge cv",
        f"{measures.edge_cv:.3f}",
        f"standard deviation of edge lengths over their mean, {measures.edge_mean:.4g}",
    )
    yield (
        "Jacobian",
        f"{measures.jacobian_mean:.3f}",
        f"scaled, mean of each quad's least; least {measures.jacobian_min:.3f}",
    )
    yield (
        "distance",
        f"{measures.hausdorff:.3g}",
        f"from the surface and back, the largest of samples; {apart:.2f} edges",
    )
