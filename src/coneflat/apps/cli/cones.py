"""`coneflat cones`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from ...options import FindOptions
from ...text import plural
from .options import keywords, option_flags
from .shared import checking, input_options, verbosity_options

#: What is allowed by default.
DISTORTION = FindOptions().distortion

if TYPE_CHECKING:
    from ...curve import ConeCurve, FoundCones


@click.command(short_help="Find cones, or show what how many of them gain.")
@click.argument("mesh", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    help="File to write the cones to, VERTEX CURVATURE on each line, for flatten --cones.",
)
@option_flags(FindOptions, one_mesh=True)
@click.option(
    "--curve", is_flag=True, help="A table and a picture of the area distortion against the number of cones."
)
@click.option(
    "--most", type=int, default=30, show_default=True, help="With --curve: the largest number of cones."
)
@click.option(
    "--picture",
    type=click.Path(path_type=Path),
    help="With --curve: the picture to write.  [default: MESH's name with _cones, as .png]",
)
@input_options
@verbosity_options
@click.pass_context
def cones(
    context: click.Context,
    /,
    mesh: Path,
    output: Path | None,
    curve: bool,
    most: int,
    picture: Path | None,
    repair: bool,
    weld: bool | None,
    verbosity: str | None,
    **search: Any,
) -> None:
    """Find the cones of MESH's largest component, without flattening it.

    \b
    Examples:
      coneflat cones horse.ply --distortion 0.1 -o horse.cones
      coneflat cones horse.ply --curve
    """
    from ...curve import cone_curve, find_cones
    from ...files import atomic_write
    from ...files.atomic import check_target
    from ...files.read import read_joined
    from ...view import check_figure_target, make_figure, new_figure, save_figure
    from .console import Console
    from .run import FLATTENED, READ

    if curve:
        new_figure(1, 1)  # says what is missing before the work
        picture = picture or Path(f"{mesh.stem}_cones.png")
    else:
        for name, is_given in (
            ("--picture", picture is not None),
            ("--most", context.get_parameter_source("most") is not ParameterSource.DEFAULT),
        ):
            if is_given:
                raise click.UsageError(f"only --curve takes {name}: add it, or leave out {name}", context)
    if output is not None:
        check_target(output)
    if picture is not None:
        check_figure_target(picture)
    given = {**keywords(search, FindOptions), **checking(repair)}
    with Console(verbosity) as console:
        with console.stage("read", 0.0):
            joined = read_joined(mesh, weld)
            source, given = joined.mesh, joined.renamed(given)
        with console.stage("cones", READ):
            chosen = find_cones(source, progress=console.part(READ, 0.5 if curve else FLATTENED), **given)
        console.say(f"note: {note}" for note in joined.notes())
        if curve:
            wanted = given.pop("distortion", DISTORTION)
            given.pop("cone_count", None)
            with console.stage("curve", 0.5):
                most = max(most, len(chosen.vertices))
                found = cone_curve(source, most=most, progress=console.part(0.5, FLATTENED), **given)
            console.say(_curve_lines(found, wanted))
        else:
            console.say(
                _cone_lines(chosen, None if "cone_count" in given else given.get("distortion", DISTORTION))
            )
        if picture is not None:
            with console.stage("draw", FLATTENED):
                save_figure(make_figure(found, "curve", distortion=wanted, title=mesh.name), picture)
        if output is not None:
            with atomic_write(output, "w") as file:
                for vertex, curvature in zip(chosen.vertices, chosen.curvatures, strict=True):
                    file.write(f"{vertex} {float(curvature)!r}\n")
        console.finish([path for path in (picture, output) if path is not None])


def _curve_lines(curve: ConeCurve, wanted: float) -> Iterator[str]:
    yield "cones  area distortion E"
    for each in curve.sets:
        number = len(each.vertices)
        marks = ["knee"] * (number == curve.knee) + [f"<= {wanted:g}"] * (each.distortion <= wanted)
        yield f"{number:5d}  {each.distortion:.4f}  {', '.join(marks)}".rstrip()


def _cone_lines(cones: FoundCones, allowed: float | None) -> Iterator[str]:
    """Yield a line for each cone; allowed: the distortion that was to be reached, if one was."""
    for vertex, curvature in zip(cones.vertices, cones.curvatures, strict=True):
        yield f"vertex {vertex:8d}  curvature {curvature / math.pi:+.4f} pi"
    yield f"{plural(len(cones.vertices), 'cone')}, area distortion {cones.distortion:.4f}"
    if allowed is not None and cones.distortion > allowed * (1 + 1e-9):
        yield f"note: above the {allowed:g} allowed: no better was found within the bounds given"
