"""`coneflat figure`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from ...errors import OptionError
from ...options.quads import QUADS
from .shared import Eye, again_option, checking, color_option, input_options, up_option, verbosity_options

if TYPE_CHECKING:
    from ...grid import QuadMesh
    from .console import Console

KINDS = ("layout", "checker", "quality", "cones", "curvature", "color", "curve", "quads")

_VIEWS = ("checker", "quality", "color", "cones", "curvature")
#: The kinds that an option means something for.
_TAKEN_BY = {
    "eye": (*_VIEWS, "quads"),
    "up": (*_VIEWS, "quads"),
    "colors": ("quality", "color", "curvature"),
    "color": ("color",),
    "cells": ("checker",),
    "color_charts": ("layout",),
    "most": ("curve",),
    "quads": ("quads",),
    "again": ("layout", *_VIEWS),
}


@click.command(short_help="Draw a flattening: its layout, texture, quality, cones or curvature.")
@click.argument("mesh", type=click.Path(path_type=Path))
@click.option(
    "--kind",
    type=click.Choice(KINDS),
    default="layout",
    show_default=True,
    help="layout: the charts in the unit square.  checker: the model with a checkerboard.  quality: distortion of "
    "angles and scale.  color: numbers of your own.  cones: cones and seams on the model.  curvature: before "
    "and after.  curve: distortion against the number of cones.  quads: the model made into quads.",
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
@up_option
@click.option("--size", type=float, nargs=2, metavar="WIDTH HEIGHT", help="Inches.  [default: what it needs]")
@click.option("--dpi", type=float, default=300.0, show_default=True, help="Dots per inch of pictures.")
@color_option
@click.option("--colors", metavar="NAME", help="Of quality, color and curvature: a colour map of matplotlib.")
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
@click.option("--quads", type=int, help=f"Of quads: about how many.  [default: {QUADS}]")
@again_option
@input_options
@click.option("--title", default="", help="A line above all.")
@verbosity_options
@click.pass_context
def figure(
    context: click.Context,
    /,
    mesh: Path,
    kind: str,
    output: Path | None,
    eye: tuple[Any, ...],
    most: int,
    quads: int | None,
    color: str | None,
    again: bool,
    repair: bool,
    weld: bool | None,
    verbosity: str | None,
    **look: Any,
) -> None:
    """Draw MESH for print: the UVs that it has, or those of a result (.npz); without any it is flattened first.

    \b
    Examples:
      coneflat figure bunny.obj --kind layout -o bunny.svg
      coneflat figure horse.ply --kind checker --up z --eye right-back --eye left-front
      coneflat figure hand.obj --kind quads --quads 3000
      coneflat figure scan.ply --color quality
      coneflat flatten horse.ply -o horse.npz --distortion 0.1 && coneflat figure horse.npz --kind quality
    """
    from ...curve import cone_curve
    from ...view import Look, check_figure_target, make_figure, new_figure, save_figure
    from ...view.own import own_quantity
    from .console import Console
    from .run import FLATTENED, READ, archive_of, open_result

    if color is not None and context.get_parameter_source("kind") is ParameterSource.DEFAULT:
        kind = "color"
    if color is None and kind == "color":
        raise click.UsageError("--kind color needs --color", context)
    _check_combinations(context, kind)
    # What can fail at the end is looked at before the work.
    new_figure(1, 1)
    output = check_figure_target(output or Path(f"{mesh.stem}_{kind}.png"))
    look |= {"eyes": eye or ("front-right",), "size": look["size"] or None}
    Look(**look)
    with Console(verbosity) as console:
        shown: Any
        if kind == "curve":
            with console.stage("read", 0.0):
                surface, notes = _surface(mesh, weld)
            console.say(f"note: {note}" for note in notes)
            with console.stage("cones", READ):
                shown = cone_curve(
                    surface,
                    most=most,
                    repair=repair,
                    strict=not repair,
                    progress=console.part(READ, FLATTENED),
                )
        elif kind == "quads":
            shown, notes = _quads(mesh, console, quads, repair=repair, weld=weld)
            console.say(f"note: {note}" for note in notes)
        else:
            shown = open_result(mesh, console, again=again, repair=repair, weld=weld)
            if color is not None:
                look["own"] = own_quantity(shown, color, archive_of(mesh))
            console.say(f"note: {note}" for note in shown.notes)
        with console.stage("draw", FLATTENED):
            save_figure(make_figure(shown, kind, **look), output)
        console.finish([output])


def _surface(file: Path, weld: bool | None) -> tuple[Any, tuple[str, ...]]:
    """Return what a search for cones takes, a mesh file as it is, of a result its mesh; and notes on reading it."""
    from ...files import read_flattening
    from ...files.read import read_joined

    if file.suffix.lower() != ".npz":
        joined = read_joined(file, weld)
        return joined.mesh, joined.notes()
    result = read_flattening(file)
    return (result.vertices, result.faces), ()


def _quads(
    file: Path, console: Console, count: int | None, *, repair: bool, weld: bool | None
) -> tuple[QuadMesh, tuple[str, ...]]:
    """Return the quads that a .npz file holds, or those of a mesh; and notes on them."""
    from ...files.quads import read_quads
    from ...files.read import read_joined
    from ...grid.quads import quads
    from .run import FLATTENED, READ

    with console.stage("read", 0.0):
        if file.suffix.lower() == ".npz":
            if count is not None:
                raise OptionError(f"{file} holds quads: leave out --quads")
            found = read_quads(file)
            return found, found.notes
        joined = read_joined(file, weld)
    found = quads(joined.mesh, quads=count, progress=console.part(READ, FLATTENED), **checking(repair))
    console.seconds.update(found.seconds)
    return found, joined.notes_of(found.notes)


def _check_combinations(context: click.Context, kind: str) -> None:
    """Refuse options that would have no effect."""
    for name, kinds in _TAKEN_BY.items():
        if kind not in kinds and context.get_parameter_source(name) is not ParameterSource.DEFAULT:
            option = name.replace("_", "-")
            raise click.UsageError(f"--kind {kind} takes no --{option}: only {', '.join(kinds)} do", context)
