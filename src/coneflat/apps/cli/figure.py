"""`coneflat figure` and `coneflat demo`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ...errors import OptionError
from ..quads.options import QUADS
from .options import chosen, eye_of, flag, flag_of, is_given, option_flags, path_flag
from .shared import again_option, checking, color_option, input_options, up_option, verbosity_options

if TYPE_CHECKING:
    from ... import QuadMesh
    from .run import Console

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


@dataclass(frozen=True, kw_only=True)
class FigureFlags:
    """Output.

    Attributes:
        kind: layout: the charts in the unit square.  checker: the model with a checkerboard.  quality: distortion of
            angles and scale.  color: numbers of your own.  cones: cones and seams on the model.  curvature: before and
            after.  curve: distortion against the number of cones.  quads: the model made into quads.
        output: File to write: .png, .svg or .pdf.  [default: MESH's name with _KIND, as .png]
        eye: Where to look from: front, back, left, right, top, bottom, two of them for three quarters, or a direction
            X,Y,Z; repeat for several views.  [default: front-right]
        size: Inches.  [default: what it needs]
        dpi: Dots per inch of pictures.
        colors: Of quality, color and curvature: a colour map of matplotlib.
        cells: Of the checkerboard: so many in a row as long as the root of the area.
        color_charts: Of the layout: a colour for each chart.
        most: Of the curve: the largest number of cones.
        quads: Of quads: about how many.
        title: A line above all.
    """

    kind: str = flag("layout", type=click.Choice(KINDS))
    output: Path | None = path_flag()
    eye: tuple[Any, ...] = flag((), type=eye_of, metavar="EYE", multiple=True)
    size: tuple[float, float] | None = flag(type=float, nargs=2, metavar="WIDTH HEIGHT")
    dpi: float = flag(300.0, type=float)
    colors: str | None = flag(metavar="NAME")
    cells: float = flag(36.0, type=float)
    color_charts: bool = flag(False, is_flag=True)
    most: int = flag(30, type=int)
    quads: int = flag(QUADS, type=int)
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
    **given: Any,
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
    from ... import cone_curve
    from ..view import Look, check_figure, make_figure, new_figure, own_quantity, save_figure
    from .run import FLATTENED, READ, Console, archive_of, open_result

    flags = chosen(given, FigureFlags)
    kind = "color" if color is not None and not is_given(context, "kind") else flags.kind
    if color is None and kind == "color":
        raise click.UsageError("--kind color needs --color", context)
    _check_combinations(context, kind)
    # What can fail at the end is looked at before the work.
    new_figure(1, 1)
    output = check_figure(flags.output or Path(f"{mesh.stem}_{kind}.png"))
    look: dict[str, Any] = {"up": up, "eyes": flags.eye or ("front-right",)}
    look |= {
        name: getattr(flags, name) for name in ("size", "dpi", "colors", "cells", "color_charts", "title")
    }
    Look(**look)
    with Console(verbosity) as console:
        shown: Any
        if kind == "curve":
            with console.stage("read", 0.0):
                surface, notes = _surface(mesh, weld)
            console.say(f"note: {note}" for note in notes)
            with console.stage("cones", READ):
                part = console.part(READ, FLATTENED)
                shown = cone_curve(surface, most=flags.most, progress=part, **checking(repair))
        elif kind == "quads":
            count = flags.quads if is_given(context, "quads") else None
            shown, notes = _quads(mesh, console, count, repair=repair, weld=weld)
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
    from ... import read_flattening
    from ...io import read_joined

    if file.suffix.lower() != ".npz":
        joined = read_joined(file, weld)
        return joined.mesh, joined.notes()
    result = read_flattening(file)
    return (result.vertices, result.faces), ()


def _quads(
    file: Path, console: Console, count: int | None, *, repair: bool, weld: bool | None
) -> tuple[QuadMesh, tuple[str, ...]]:
    """Return the quads that a .npz file holds, or those of a mesh; and notes on them."""
    from ... import quads
    from ...io import read_joined
    from ..quads.files import read_quads
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
        if kind not in kinds and is_given(context, name):
            raise click.UsageError(
                f"--kind {kind} takes no {flag_of(name)}: only {', '.join(kinds)} do", context
            )


@click.command(short_help="Flatten a sample model, and draw it.")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    default=Path("coneflat-demo"),
    show_default=True,
    help="Folder to write to; made if it is missing.",
)
@verbosity_options
def demo(output: Path, verbosity: str | None) -> None:
    """Flatten the sample that comes with coneflat; write the textured mesh, its report and a picture."""
    from ... import sample_path
    from ...io import make_folder
    from ..view import demo_figure, new_figure, save_figure
    from .run import FLATTENED, Console, flatten_file, save

    new_figure(1, 1)  # says what is missing before the work
    make_folder(output)
    mesh, report, picture = (output / f"sample.{ending}" for ending in ("obj", "json", "png"))
    with Console(verbosity) as console:
        result = flatten_file(sample_path(), console, {"charts": "atlas"})
        result = save(result, console, mesh, report)
        with console.stage("draw", FLATTENED):
            save_figure(demo_figure(result), picture)
        console.finish([mesh, report, picture], result)
        console.say(["", "Now try your own:  coneflat flatten MESH -o OUT.obj"])
