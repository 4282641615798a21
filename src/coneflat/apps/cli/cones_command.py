"""`coneflat cones`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ...base import DISTORTION, MAX_CONES, plural
from ...options import FindOptions
from .checks import is_given
from .flags import flag, keywords, option_flags, path_flag, pop_flags
from .grouped_help import GroupedCommand
from .shared_flags import input_options, verbosity_options

if TYPE_CHECKING:
    from ... import ConeCurve
    from ...curves import FoundCones


@dataclass(frozen=True, kw_only=True)
class ConeFlags:
    """Output.

    Attributes:
        output: File for the cones, one line VERTEX CURVATURE for each, which flatten --cones reads.
        curve: Print a table, and draw a picture, of the area distortion against the number of cones.
        most: Largest number of cones of the curve.
        picture: File for the picture of the curve.  [default: MESH's name with _cones, as .png]
    """

    output: Path | None = path_flag()
    curve: bool = flag(False, is_flag=True)
    most: int = flag(MAX_CONES, type=int)
    picture: Path | None = path_flag()


@click.command(cls=GroupedCommand, short_help="Find cones, or show the distortion for each number of cones.")
@click.argument("mesh", type=click.Path(path_type=Path))
@option_flags(FindOptions)
@option_flags(ConeFlags)
@input_options
@verbosity_options
@click.pass_context
def cones(
    context: click.Context, /, mesh: Path, weld: bool | None, verbosity: str | None, **params: Any
) -> None:
    """Find the cones of the largest component of MESH, without flattening it.

    \b
    Examples:
      coneflat cones horse.ply --distortion 0.1 -o horse.cones
      coneflat cones horse.ply --curve
    """
    from ... import cone_curve, find_cones
    from ...io import check_target, read_joined
    from ..view import make_figure, save_figure
    from .run import Console

    flags, options = pop_flags(params, ConeFlags), keywords(params, FindOptions)
    picture = _checked_picture(context, flags, mesh)
    if flags.output is not None:
        check_target(flags.output)
    with Console(verbosity) as console:
        with console.stage("read", 0.0):
            joined = read_joined(mesh, weld)
            source, options = joined.mesh, joined.map_options(options)
        with console.stage("cones", console.READ):
            found_cones = find_cones(
                source, progress=console.part(end=0.5 if flags.curve else console.FLATTENED), **options
            )
        console.notes(joined.notes())
        distortion = options.pop("distortion", DISTORTION)
        options.pop("cone_count", None)
        if flags.curve:
            with console.stage("curve", 0.5):
                max_count = max(flags.most, len(found_cones.vertices))
                curve = cone_curve(source, most=max_count, progress=console.part(0.5), **options)
            console.say(_curve_lines(curve, distortion))
        else:
            console.say(_cone_lines(found_cones))
            console.notes(found_cones.notes)
        if picture is not None:
            with console.stage("draw"):
                save_figure(make_figure(curve, "curve", distortion=distortion, title=mesh.name), picture)
        if flags.output is not None:
            _write_cones(found_cones, flags.output)
        console.finish([path for path in (picture, flags.output) if path is not None])


def _checked_picture(context: click.Context, flags: ConeFlags, mesh: Path) -> Path | None:
    """Return the file for the picture of the curve, if it is requested; errors are reported before the work starts."""
    from ..view import check_figure, new_figure

    if flags.curve:
        new_figure(1, 1)
        return check_figure(flags.picture or Path(f"{mesh.stem}_cones.png"))
    for name in ("picture", "most"):
        if is_given(context, name):
            raise click.UsageError(f"--{name} has no effect without --curve: add --curve", context)
    return None


def _write_cones(cones: FoundCones, path: Path) -> None:
    """Write a line VERTEX CURVATURE for each cone."""
    from ...io import atomic_write

    with atomic_write(path, "w") as file:
        for vertex, curvature in zip(cones.vertices, cones.curvatures, strict=True):
            file.write(f"{vertex} {float(curvature)!r}\n")


def _curve_lines(curve: ConeCurve, distortion: float) -> Iterator[str]:
    yield "cones  area distortion E"
    for cone_set in curve.sets:
        number = len(cone_set.vertices)
        marks = ["knee"] * (number == curve.knee) + [f"<= {distortion:g}"] * (
            cone_set.distortion <= distortion
        )
        yield f"{number:5d}  {cone_set.distortion:.4f}  {', '.join(marks)}".rstrip()


def _cone_lines(cones: FoundCones) -> Iterator[str]:
    """Yield a line for each cone, and the distortion."""
    for vertex, curvature in zip(cones.vertices, cones.curvatures, strict=True):
        yield f"vertex {vertex:8d}  curvature {curvature / math.pi:+.4f} pi"
    yield f"{plural(len(cones.vertices), 'cone')}, area distortion {cones.distortion:.4f}"
