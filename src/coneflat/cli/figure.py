"""`coneflat figure`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

KINDS = ("layout", "checker", "quality", "cones", "curvature", "curve")

_VIEWS = ("checker", "quality", "cones", "curvature")
#: The kinds that an option means something for.
_TAKEN_BY = {
    "eye": _VIEWS,
    "up": _VIEWS,
    "colors": ("quality", "curvature"),
    "cells": ("checker",),
    "color_charts": ("layout",),
    "most": ("curve",),
}


class Eye(click.ParamType):  # type: ignore[type-arg]
    """A direction: 1,0.5,2, or words such as front-right."""

    name = "eye"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return three numbers, or the words."""
        if not isinstance(value, str) or "," not in value:
            return value
        try:
            return tuple(float(number) for number in value.split(","))
        except ValueError:
            self.fail(f"{value!r} is no direction; write 1,0.5,2 or front-right", param, ctx)


@click.command(short_help="Draw a flattening: its layout, texture, quality, cones or curvature.")
@click.argument("mesh", type=click.Path(path_type=Path))
@click.option(
    "--kind",
    type=click.Choice(KINDS),
    default="layout",
    show_default=True,
    help="layout: the charts in the unit square.  checker: the model with a checkerboard.  quality: distortion of "
    "angles and scale.  cones: cones and seams on the model.  curvature: before and after.  curve: distortion "
    "against the number of cones.",
)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    help="File to write: .png, .svg or .pdf.  [default: MESH's name with _KIND, as .png]",
)
@click.option(
    "--eye",
    type=Eye(),
    metavar="EYE",
    multiple=True,
    help="Where to look from: front, back, left, right, top, bottom, two of them for three quarters, or a direction "
    "X,Y,Z; repeat for several views.  [default: front-right]",
)
@click.option(
    "--up",
    type=click.Choice(["x", "y", "z"]),
    default="y",
    show_default=True,
    help="The model's upward axis.",
)
@click.option("--size", type=float, nargs=2, metavar="WIDTH HEIGHT", help="Inches.  [default: what it needs]")
@click.option("--dpi", type=float, default=300.0, show_default=True, help="Dots per inch of pictures.")
@click.option("--colors", metavar="NAME", help="Of quality and curvature: a colour map of matplotlib.")
@click.option(
    "--cells",
    type=float,
    default=36.0,
    show_default=True,
    help="Of the checkerboard: so many in a row as long as the root of the area.",
)
@click.option("--color-charts", is_flag=True, help="Of the layout: a colour for each chart.")
@click.option(
    "--most", type=int, default=30, show_default=True, help="Of the curve: the largest number of cones."
)
@click.option("--repair", is_flag=True, help="Split non-manifold edges and vertices, drop degenerate faces.")
@click.option("--title", default="", help="A line above all.")
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
@click.pass_context
def figure(
    context: click.Context,
    /,
    mesh: Path,
    kind: str,
    output: Path | None,
    eye: tuple[Any, ...],
    most: int,
    repair: bool,
    quiet: bool,
    **look: Any,
) -> None:
    """Draw MESH for print: a mesh, which is flattened first with all defaults, or a result of coneflat (.npz).

    \b
    Examples:
      coneflat figure bunny.obj --kind layout -o bunny.svg
      coneflat figure horse.ply --kind checker --up z --eye right-back --eye left-front
      coneflat flatten horse.ply -o horse.npz --distortion 0.1 && coneflat figure horse.npz --kind quality
    """
    from ..curve import cone_curve
    from ..io import read_flattening, read_mesh
    from ..pipeline import flatten
    from ..view import Look, check_figure_target, make_figure, new_figure, save_figure
    from .console import Console

    _check_combinations(context, kind)
    # What can fail at the end is looked at before the work.
    new_figure(1, 1)
    output = check_figure_target(output or Path(f"{mesh.stem}_{kind}.png"))
    look |= {"eyes": eye or ("front-right",), "size": look["size"] or None}
    Look(**look)
    with Console(quiet) as console:
        console.progress("read", 0.0)
        shown: Any = (read_flattening if mesh.suffix.lower() == ".npz" else read_mesh)(mesh)
        if kind == "curve":
            console.progress("cones", 0.1)
            shown = cone_curve(_surface(shown), most=most, repair=repair)
        elif mesh.suffix.lower() != ".npz":
            shown = flatten(shown, charts="atlas", repair=repair, progress=console.progress)
        console.progress("draw", 1.0)
        save_figure(make_figure(shown, kind, **look), output)
    if not quiet:
        click.echo(f"wrote {output}")


def _surface(shown: Any) -> Any:
    """Return what a search for cones takes: a mesh file as it is, of a result its mesh."""
    return (shown.vertices, shown.faces) if hasattr(shown, "uv") else shown


def _check_combinations(context: click.Context, kind: str) -> None:
    """Refuse options that would have no effect."""
    for name, kinds in _TAKEN_BY.items():
        if kind not in kinds and context.get_parameter_source(name) is not ParameterSource.DEFAULT:
            option = name.replace("_", "-")
            raise click.UsageError(f"--kind {kind} takes no --{option}: only {', '.join(kinds)} do", context)
