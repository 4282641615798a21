"""Options that say how to flatten, which several commands have."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import click
from click.core import ParameterSource

from .search import PURSUIT_OPTIONS, Angle, Direction, as_keywords, search_options
from .shared import checking, input_options

Command = TypeVar("Command", bound=Callable[..., Any])

QUANTUM_OPTIONS = ("quantise", "correct_handles")
SEARCH_OPTIONS = ("cones", "epsilon", "max_cones", *PURSUIT_OPTIONS, *QUANTUM_OPTIONS)
EXACT_OPTIONS = ("at_cones", "boundary", "corner", "refine")
#: As in `coneflat.options`, which takes a while to load.
METHODS = ("exact", "linear", "circle-patterns", "ricci", "linear-abf", "abf++", "lscm", "spectral", "bff")
VARIANTS = ("circle-patterns/fixed", "linear-abf/free", "abf++/free")
# Formats of models to be textured, where nothing may overlap.
TEXTURED = (".obj", ".glb")
METHOD_OPTIONS = (*SEARCH_OPTIONS, "cone", "cones_file", "method", "lengths", *EXACT_OPTIONS)

_BEFORE_SEARCH = (
    click.option("--paper", is_flag=True, help="The method exactly as published (Ben-Chen et al. 2008)."),
    click.option(
        "--cones",
        type=click.Choice(["auto", "pursuit", "greedy", "none"]),
        default="auto",
        show_default=True,
        help="How to find cones.  pursuit: the fewest for the distortion allowed.  greedy: the paper's.  none: for "
        "bounded meshes and tori.  auto: pursuit, but none where the boundary is prescribed, and greedy where handles "
        "need over a hundred.",
    ),
)
_AFTER_SEARCH = (
    click.option(
        "--quantise",
        type=Angle(),
        metavar="ANGLE",
        help="Cones whose curvatures are multiples of this, pi/2 say, so that seams turn by such multiples.",
    ),
    click.option(
        "--correct-handles",
        is_flag=True,
        help="With --quantise: make rotations around handles multiples, too, by a map that is not quite conformal.",
    ),
    click.option(
        "--epsilon",
        type=float,
        default=1.0,
        show_default=True,
        help="The greedy search stops when the log of the scale varies by at most this.",
    ),
    click.option("--max-cones", type=int, help="Searches stop at this many cones."),
    click.option(
        "--method",
        type=click.Choice(METHODS + VARIANTS),
        metavar="METHOD",
        default="exact",
        show_default=True,
        help="exact: no curvature error, no flipped triangle.  linear: the paper's.  For comparison: "
        f"{', '.join(METHODS[2:] + VARIANTS)}.",
    ),
    click.option(
        "--at-cones",
        type=click.Choice(["auto", "scale", "curvature"]),
        default="auto",
        show_default=True,
        help="Exact metric: prescribe scale 1 at cones, or the curvatures that the search found.",
    ),
    click.option(
        "--boundary",
        type=click.Choice(["free", "lengths", "disk", "straight"]),
        default="free",
        show_default=True,
        help="Exact metric: free (least area distortion), lengths (kept at the model's scale), a round disk, or "
        "straight sides between corners that the search finds.",
    ),
    click.option("--best-effort", is_flag=True, help="Write a result even if the metric did not converge."),
    click.option(
        "--lengths",
        type=click.Choice(["integral", "mean"]),
        default="integral",
        show_default=True,
        help="Linear metric: scale an edge by the mean of the scale along it, or by the scale at the mean.",
    ),
    click.option(
        "--refine",
        is_flag=True,
        help="Exact metric: cut the input's triangles along the flat triangulation's edges; nothing can be inverted.",
    ),
    click.option(
        "--charts",
        type=click.Choice(["one", "atlas"]),
        help="one: a single chart per component, as in the paper, which may overlap itself.  atlas: seams moved, and "
        "cuts where it must be, so that nothing overlaps.  [default: atlas for .obj and .glb, but one with --paper]",
    ),
    click.option(
        "--resolution",
        type=int,
        default=1024,
        show_default=True,
        help="Texels along a side of the texture, for --padding.",
    ),
    click.option(
        "--padding", type=float, default=2.0, show_default=True, help="Texels between charts, at least."
    ),
    click.option(
        "--tiles", type=int, default=1, show_default=True, help="Textures (UDIM) to distribute charts over."
    ),
    click.option(
        "--up",
        type=Direction(),
        metavar="DIRECTION",
        help="What is up in the model is to be up in the texture: x, y, z, -z, or 0,1,0.",
    ),
    click.option(
        "--sharp-angle",
        type=Angle(),
        metavar="ANGLE",
        help="Cut edges at which the surface bends by more, 40deg say: CAD parts open there.",
    ),
    click.option(
        "--creases",
        type=float,
        default=0.0,
        show_default=True,
        help="How much seams prefer sharp edges: at 1, one of 60 degrees and more costs a tenth of its length.",
    ),
    click.option(
        "--hide-seams",
        is_flag=True,
        help="Seams prefer what can hardly be seen: a tenth of the cost in deep folds and, with --up, below.",
    ),
    click.option("--keep-seams", is_flag=True, help="Cut where the file's own UV coordinates have seams."),
    click.option(
        "--solver",
        type=click.Choice(["auto", "pardiso", "cholespy", "scipy", "amg"]),
        default="auto",
        show_default=True,
        help="What solves the linear systems; auto is the fastest installed.  amg iterates, for what fits no other.",
    ),
)


def method_options(command: Command) -> Command:
    """Add the options that do not name vertices of one mesh."""
    command = input_options(command)
    for option in reversed(_AFTER_SEARCH):
        command = option(command)
    command = search_options(command)
    for option in reversed(_BEFORE_SEARCH):
        command = option(command)
    return command


def method_keywords(params: Mapping[str, Any], ending: str) -> dict[str, Any]:
    """Return keyword arguments of `coneflat.flatten` from the values of the options.

    ending: of the files to be written.

    Raises:
        OptionError: vertices or weights are not what they should be.
        MeshFileError: a file of them cannot be read.
    """
    general = {name: params[name] for name in ("solver", "charts")} | checking(params["repair"])
    if general["charts"] is None:
        general["charts"] = "atlas" if ending in TEXTURED and not params["paper"] else "one"
    general |= {name: params[name] for name in ("resolution", "padding", "tiles", "up")}
    general |= {"creases": params["creases"], "hide_seams": float(params["hide_seams"])}
    general["sharp_angle"] = params["sharp_angle"]
    if params["keep_seams"]:
        general["seams"] = "input"
    if params["paper"]:
        from ...options import PAPER

        return {**PAPER, **general}
    same = (
        "cones",
        "correct_handles",
        "epsilon",
        "max_cones",
        "method",
        "at_cones",
        "boundary",
        "best_effort",
    )
    return {
        **as_keywords(params),
        **{name: params[name] for name in (*same, "refine")},
        "quantum": params["quantise"],
        "length_rule": params["lengths"],
        **general,
    }


def check_combinations(context: click.Context) -> None:
    """Refuse options that would have no effect."""
    params = context.params
    cones, method = params["cones"], params["method"]
    rules = [
        (params["paper"], METHOD_OPTIONS, "--paper fixes the method"),
        (
            params.get("cone") or params.get("cones_file"),
            SEARCH_OPTIONS,
            "with cones given there is nothing to search",
        ),
        (cones == "none", SEARCH_OPTIONS[1:], "--cones none searches for none"),
        (cones == "greedy", (*PURSUIT_OPTIONS, *QUANTUM_OPTIONS), "--cones greedy has no such choice"),
        (cones in ("auto", "pursuit"), ("epsilon",), "only --cones greedy has this choice"),
        (params["cone_count"] is not None, ("distortion", "max_cones"), "the number of cones is given"),
        (method != "exact", EXACT_OPTIONS, f"--method {method} has no such choice"),
        (method != "linear", ("lengths",), "only --method linear has this choice"),
    ]
    for applies, names, reason in rules:
        for name in names if applies else ():
            if context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
                raise click.UsageError(f"{reason}: leave out --{name.replace('_', '-')}", context)
    if context.params.get("corner") and context.params["boundary"] != "free":
        raise click.UsageError("--corner makes a polygon: leave out --boundary", context)
