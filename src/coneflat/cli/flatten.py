"""`coneflat flatten`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

METHOD_OPTIONS = ("cones", "cone", "cones_file", "epsilon", "max_cones", "metric", "lengths")


@click.command(short_help="Flatten a mesh and write it with UV coordinates.")
@click.argument("mesh", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    help="File to write: .obj, .ply, .glb or .npz.  [default: MESH's name with _uv, as .obj]",
)
@click.option("--paper", is_flag=True, help="The method exactly as published (Ben-Chen et al. 2008).")
@click.option(
    "--cones",
    type=click.Choice(["greedy", "none"]),
    default="greedy",
    show_default=True,
    help="How to find cones; none suits bounded meshes and tori.",
)
@click.option(
    "--cone",
    metavar="VERTEX[:CURVATURE]",
    multiple=True,
    help="Use this vertex (from 0, as in the file) as a cone; repeat for more.  Curvatures such as 1.57, "
    "pi/2, -0.5pi or 90deg are taken as they are; without, the best ones are computed.",
)
@click.option(
    "--cones-file",
    type=click.Path(path_type=Path),
    help="Read cones from a text file, VERTEX [CURVATURE] on each line.",
)
@click.option(
    "--epsilon",
    type=float,
    default=1.0,
    show_default=True,
    help="The greedy search stops when the log scale varies by at most this.",
)
@click.option("--max-cones", type=int, help="The greedy search stops at this many cones.")
@click.option("--metric", type=click.Choice(["linear"]), default="linear", show_default=True)
@click.option(
    "--lengths",
    type=click.Choice(["integral", "mean"]),
    default="integral",
    show_default=True,
    help="Scale an edge by the mean of the scale along it, or by the scale at the mean.",
)
@click.option("--repair", is_flag=True, help="Split non-manifold edges and vertices, drop degenerate faces.")
@click.option("--strict", is_flag=True, help="Refuse triangles without area instead of opening them.")
@click.option(
    "--weld/--no-weld",
    default=None,
    help="Merge vertices at the same position.  [default: for STL and glTF only]",
)
@click.option("--report", type=click.Path(path_type=Path), help="Write all measures to this JSON file.")
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
@click.pass_context
def flatten(
    context: click.Context,
    mesh: Path,
    output: Path | None,
    paper: bool,
    cones: str,
    cone: tuple[str, ...],
    cones_file: Path | None,
    epsilon: float,
    max_cones: int | None,
    metric: str,
    lengths: str,
    repair: bool,
    strict: bool,
    weld: bool | None,
    report: Path | None,
    quiet: bool,
) -> None:
    """Flatten MESH (.obj, .ply, .stl, .off, .gltf, .glb) and write it with UV coordinates.

    \b
    Examples:
      coneflat flatten horse.ply -o horse.obj
      coneflat flatten hand.obj -o hand.glb --max-cones 20 --report hand.json
      coneflat flatten part.stl --cone 12 --cone 507 --cone 1044
    """
    from .cones import parse_cones
    from .run import run

    _check_combinations(context, paper, bool(cone or cones_file))
    given = parse_cones(cone, cones_file)
    options: dict[str, Any]
    if paper:
        from ..options import PAPER

        options = dict(PAPER)
    else:
        options = {
            "cones": given or cones,
            "epsilon": epsilon,
            "max_cones": max_cones,
            "metric": metric,
            "length_rule": lengths,
        }
    run(mesh, output, {**options, "repair": repair, "strict": strict}, weld=weld, report=report, quiet=quiet)


def _check_combinations(context: click.Context, paper: bool, has_given: bool) -> None:
    def was_given(name: str) -> bool:
        return context.get_parameter_source(name) is ParameterSource.COMMANDLINE

    if paper:
        for name in filter(was_given, METHOD_OPTIONS):
            raise click.UsageError(f"--paper fixes the method: leave out --{name.replace('_', '-')}", context)
    if has_given:
        for name in filter(was_given, ("cones", "epsilon", "max_cones")):
            raise click.UsageError(
                f"with cones given there is nothing to search: leave out --{name.replace('_', '-')}", context
            )
