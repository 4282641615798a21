"""`coneflat flatten`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from .search import PURSUIT_OPTIONS, Angle, as_keywords, search_options

QUANTUM_OPTIONS = ("quantise", "correct_handles")
SEARCH_OPTIONS = ("cones", "epsilon", "max_cones", *PURSUIT_OPTIONS, *QUANTUM_OPTIONS)
EXACT_OPTIONS = ("at_cones", "boundary", "corner", "best_effort", "refine")
METHOD_OPTIONS = (*SEARCH_OPTIONS, "cone", "cones_file", "metric", "lengths", *EXACT_OPTIONS)


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
    type=click.Choice(["auto", "pursuit", "greedy", "none"]),
    default="auto",
    show_default=True,
    help="How to find cones.  pursuit: the fewest for the distortion allowed.  greedy: the paper's.  none: for bounded "
    "meshes and tori.  auto: pursuit, but none where the boundary is prescribed.",
)
@search_options
@click.option(
    "--quantise",
    type=Angle(),
    metavar="ANGLE",
    help="Cones whose curvatures are multiples of this, pi/2 say, so that seams turn by such multiples.",
)
@click.option(
    "--correct-handles",
    is_flag=True,
    help="With --quantise: make rotations around handles multiples, too, by a map that is not quite conformal.",
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
    help="The greedy search stops when the log of the scale varies by at most this.",
)
@click.option("--max-cones", type=int, help="Searches stop at this many cones.")
@click.option(
    "--metric",
    type=click.Choice(["exact", "linear"]),
    default="exact",
    show_default=True,
    help="exact: no curvature error, no flipped triangle.  linear: the paper's.",
)
@click.option(
    "--at-cones",
    type=click.Choice(["auto", "scale", "curvature"]),
    default="auto",
    show_default=True,
    help="Exact metric: prescribe scale 1 at cones, or the curvatures that the search found.",
)
@click.option(
    "--boundary",
    type=click.Choice(["free", "lengths", "disk", "straight"]),
    default="free",
    show_default=True,
    help="Exact metric: free (least area distortion), lengths (kept at the model's scale), a round disk, or "
    "straight sides between corners that the search finds.",
)
@click.option(
    "--corner",
    metavar="VERTEX[:CURVATURE]",
    multiple=True,
    help="Exact metric: a polygon with this boundary vertex as a corner; repeat: four make a rectangle.",
)
@click.option("--best-effort", is_flag=True, help="Write a result even if the metric did not converge.")
@click.option(
    "--lengths",
    type=click.Choice(["integral", "mean"]),
    default="integral",
    show_default=True,
    help="Linear metric: scale an edge by the mean of the scale along it, or by the scale at the mean.",
)
@click.option(
    "--refine",
    is_flag=True,
    help="Exact metric: cut the input's triangles along the flat triangulation's edges; nothing can be inverted.",
)
@click.option("--repair", is_flag=True, help="Split non-manifold edges and vertices, drop degenerate faces.")
@click.option("--strict", is_flag=True, help="Refuse triangles without area instead of opening them.")
@click.option(
    "--solver",
    type=click.Choice(["auto", "pardiso", "scikit-sparse", "cholespy", "scipy", "amg"]),
    default="auto",
    show_default=True,
    help="What solves the linear systems; auto is the fastest installed.  amg iterates, for what fits no other.",
)
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
    /,
    mesh: Path,
    output: Path | None,
    paper: bool,
    cones: str,
    cone: tuple[str, ...],
    cones_file: Path | None,
    quantise: float | None,
    correct_handles: bool,
    epsilon: float,
    max_cones: int | None,
    metric: str,
    at_cones: str,
    boundary: str,
    corner: tuple[str, ...],
    best_effort: bool,
    refine: bool,
    lengths: str,
    repair: bool,
    strict: bool,
    solver: str,
    weld: bool | None,
    report: Path | None,
    quiet: bool,
    **search: Any,
) -> None:
    """Flatten MESH (.obj, .ply, .stl, .off, .gltf, .glb) and write it with UV coordinates.

    \b
    Examples:
      coneflat flatten horse.ply -o horse.obj
      coneflat flatten hand.obj -o hand.glb --distortion 0.1 --report hand.json
      coneflat flatten part.stl --cone 12 --cone 507 --cone 1044
      coneflat flatten sheet.obj -o flat.obj --corner 10 --corner 95 --corner 230 --corner 310
    """
    from .given import parse_vertices
    from .run import run

    _check_combinations(context)
    given = parse_vertices("cone", cone, cones_file)
    corners = parse_vertices("corner", corner)
    options: dict[str, Any]
    if paper:
        from ..options import PAPER

        options = dict(PAPER)
    else:
        options = {
            "cones": given or cones,
            **as_keywords(search),
            "quantum": quantise,
            "correct_handles": correct_handles,
            "epsilon": epsilon,
            "max_cones": max_cones,
            "metric": metric,
            "length_rule": lengths,
            "at_cones": at_cones,
            "boundary": corners or boundary,
            "best_effort": best_effort,
            "refine": refine,
        }
    options = {**options, "repair": repair, "strict": strict, "solver": solver}
    run(mesh, output, options, weld=weld, report=report, quiet=quiet)


def _check_combinations(context: click.Context) -> None:
    """Refuse options that would have no effect."""
    params = context.params
    cones, metric = params["cones"], params["metric"]
    rules = [
        (params["paper"], METHOD_OPTIONS, "--paper fixes the method"),
        (
            params["cone"] or params["cones_file"],
            SEARCH_OPTIONS,
            "with cones given there is nothing to search",
        ),
        (cones == "none", SEARCH_OPTIONS[1:], "--cones none searches for none"),
        (cones == "greedy", (*PURSUIT_OPTIONS, *QUANTUM_OPTIONS), "--cones greedy has no such choice"),
        (cones in ("auto", "pursuit"), ("epsilon",), "only --cones greedy has this choice"),
        (params["cone_count"] is not None, ("distortion", "max_cones"), "the number of cones is given"),
        (metric == "linear", EXACT_OPTIONS, "--metric linear has no such choice"),
        (metric == "exact", ("lengths",), "only --metric linear has this choice"),
    ]
    for applies, names, reason in rules:
        for name in names if applies else ():
            if context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
                raise click.UsageError(f"{reason}: leave out --{name.replace('_', '-')}", context)
    if context.params["corner"] and context.params["boundary"] != "free":
        raise click.UsageError("--corner makes a polygon: leave out --boundary", context)
