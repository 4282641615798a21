"""`coneflat figure` and `coneflat demo`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ...base import CHECKER_CELLS, DOTS_PER_INCH, MAX_CONES
from .checks import is_given
from .flag_values import parse_eye
from .flags import flag, flag_name, option_flags, path_flag, pop_flags, repair_keywords
from .shared_flags import (
    again_option,
    color_option,
    input_options,
    up_option,
    verbosity_options,
)

if TYPE_CHECKING:
    from ... import ConeCurve
    from .run import Console


KINDS = ("layout", "checker", "quality", "cones", "curvature", "color", "curve")

_VIEWS = ("checker", "quality", "color", "cones", "curvature")
#: The kinds of figures on which an option has an effect.
_KINDS_OF_OPTION = {
    "eye": _VIEWS,
    "up": _VIEWS,
    "colors": ("quality", "color", "curvature"),
    "color": ("color",),
    "cells": ("checker",),
    "qc_max": ("quality",),
    "scale_max": ("quality",),
    "color_charts": ("layout",),
    "most": ("curve",),
    "again": ("layout", *_VIEWS),
}


@dataclass(frozen=True, kw_only=True)
class FigureFlags:
    """Output.

    Attributes:
        kind: layout: the charts in the unit square.  checker: the model with a checkerboard.  quality: distortion of
            angles and scale.  color: your own values, given by --color.  cones: cones and seams on the model.
            curvature: the curvature before and after flattening.  curve: area distortion against the number of cones.
        output: File to write: .png, .svg or .pdf.  [default: MESH's name with _KIND, as .png]
        eye: Direction from which the model is seen: front, back, left, right, top, bottom, two of these for a
            three-quarter view, or a vector X,Y,Z; repeat for several views.  [default: front-right]
        size: Size in inches.  [default: depends on the content]
        dpi: Resolution in dots per inch.
        colors: sequential, diverging or a colour map of matplotlib, for quality, color and curvature.
        qc_max: QC distortion at the end of its colour scale.  [default: fits the values]
        scale_max: Scale at the end of its colour scale, which begins at the reciprocal.  [default: fits the values]
        cells: Number of checkerboard squares along the square root of the surface area.
        color_charts: Give each chart of the layout its own colour.
        most: Largest number of cones of the curve.
        title: Title above the figure.
    """

    kind: str = flag("layout", type=click.Choice(KINDS))
    output: Path | None = path_flag()
    eye: tuple[Any, ...] = flag((), type=parse_eye, metavar="EYE", multiple=True)
    size: tuple[float, float] | None = flag(type=float, nargs=2, metavar="WIDTH HEIGHT")
    dpi: float = flag(DOTS_PER_INCH, type=float)
    colors: str | None = flag(metavar="NAME")
    qc_max: float | None = flag(type=float)
    scale_max: float | None = flag(type=float)
    cells: float = flag(float(CHECKER_CELLS), type=float)
    color_charts: bool = flag(False, is_flag=True)
    most: int = flag(MAX_CONES, type=int)
    title: str = flag("")


@click.command(short_help="Draw a flattening: its layout, texture, quality, cones or curvature.")
@click.argument("mesh", type=click.Path(path_type=Path))
@option_flags(FigureFlags)
@up_option
@color_option
@again_option
@input_options
@verbosity_options
@click.pass_context
def figure(
    context: click.Context,
    /,
    mesh: Path,
    up: str,
    color: str | None,
    again: bool,
    repair: bool,
    weld: bool | None,
    verbosity: str | None,
    **params: Any,
) -> None:
    """Draw a figure of MESH and its UVs for print.

    MESH is a mesh or a result (.npz). A mesh without UVs is flattened first.

    \b
    Examples:
      coneflat figure bunny.obj --kind layout -o bunny.svg
      coneflat figure horse.ply --kind checker --up z --eye right-back --eye left-front
      coneflat figure scan.ply --color quality
      coneflat flatten horse.ply -o horse.npz --distortion 0.1 && coneflat figure horse.npz --kind quality
    """
    from ..view import Look, check_figure, make_figure, new_figure, own_quantity, save_figure
    from .run import Console, archive_path, open_result

    flags = pop_flags(params, FigureFlags)
    kind = "color" if color is not None and not is_given(context, "kind") else flags.kind
    if color is None and kind == "color":
        raise click.UsageError("--kind color needs --color", context)
    _check_combinations(context, kind)
    # Errors that writing would raise are reported before the work starts.
    new_figure(1, 1)
    output = check_figure(flags.output or Path(f"{mesh.stem}_{kind}.png"))
    look: dict[str, Any] = {"up": up, "eyes": flags.eye or ("front-right",)}
    look |= {
        name: getattr(flags, name)
        for name in ("size", "dpi", "colors", "qc_max", "scale_max", "cells", "color_charts", "title")
    }
    Look(**look)
    with Console(verbosity) as console:
        shown: Any
        if kind == "curve":
            shown = _curve(mesh, console, flags.most, weld, repair)
        else:
            shown = open_result(mesh, console, again=again, repair=repair, weld=weld)
            if color is not None:
                look["own"] = own_quantity(shown, color, archive_path(mesh))
            console.notes(shown.notes)
        with console.stage("draw"):
            save_figure(make_figure(shown, kind, **look), output)
        console.finish([output])


def _curve(mesh: Path, console: Console, max_cones: int, weld: bool | None, repair: bool) -> ConeCurve:
    """Return the cone curve of a mesh file or a result, up to a number of cones, and print the notes on reading it."""
    from ... import cone_curve

    with console.stage("read", 0.0):
        surface, notes = _surface(mesh, weld)
    console.notes(notes)
    with console.stage("cones", console.READ):
        return cone_curve(surface, most=max_cones, progress=console.part(), **repair_keywords(repair))


def _surface(file: Path, weld: bool | None) -> tuple[Any, tuple[str, ...]]:
    """Return the mesh of a mesh file or a result, and the notes on reading it."""
    from ... import read_flattening
    from ...io import read_joined

    if file.suffix.lower() != ".npz":
        joined = read_joined(file, weld)
        return joined.mesh, joined.notes()
    result = read_flattening(file)
    return (result.vertices, result.faces), ()


def _check_combinations(context: click.Context, kind: str) -> None:
    """Raise an error if an option would have no effect."""
    for name, kinds in _KINDS_OF_OPTION.items():
        if kind not in kinds and is_given(context, name):
            raise click.UsageError(
                f"{flag_name(name)} has no effect with --kind {kind}, only with {', '.join(kinds)}", context
            )


@click.command(short_help="Flatten a sample model, and draw it.")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    default=Path("coneflat-demo"),
    show_default=True,
    help="Folder for the files; created if it does not exist.",
)
@verbosity_options
def demo(output: Path, verbosity: str | None) -> None:
    """Flatten the sample model of coneflat, and write the textured mesh, its report and a picture."""
    from ... import sample_path
    from ...io import make_folder
    from ..view import demo_figure, new_figure, save_figure
    from .run import Console, flatten_file, save

    new_figure(1, 1)  # A missing package is reported before the work starts.
    make_folder(output)
    mesh, report, picture = (output / f"sample.{ending}" for ending in ("obj", "json", "png"))
    with Console(verbosity) as console:
        result = flatten_file(sample_path(), console, {"charts": "atlas"})
        result = save(result, console, mesh, report)
        with console.stage("draw"):
            save_figure(demo_figure(result), picture)
        console.finish([mesh, report, picture], result)
        console.say(["", "Now try your own:  coneflat flatten MESH -o OUT.obj"])
