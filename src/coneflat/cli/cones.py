"""`coneflat cones`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from .search import as_keywords, place_options, search_options


@click.command(short_help="Find cones, or show what how many of them gain.")
@click.argument("mesh", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    help="File to write the cones to, VERTEX CURVATURE on each line, for flatten --cones-file.",
)
@search_options
@place_options
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
@click.option("--repair", is_flag=True, help="Split non-manifold edges and vertices, drop degenerate faces.")
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
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
    quiet: bool,
    **search: Any,
) -> None:
    """Find the cones of MESH's largest component, without flattening it.

    \b
    Examples:
      coneflat cones horse.ply --distortion 0.1 -o horse.cones
      coneflat cones horse.ply --curve
    """
    from ..curve import cone_curve, find_cones
    from ..io import atomic_write, read_mesh
    from ..io.atomic import check_target
    from ..view import check_figure_target, make_figure, new_figure, save_figure

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
    keywords = {**as_keywords(search), "repair": repair}
    source = read_mesh(mesh)
    chosen = find_cones(source, **keywords)
    if curve:
        wanted = keywords.pop("distortion")
        del keywords["cone_count"]
        found = cone_curve(source, most=max(most, len(chosen.vertices)), **keywords)
        lines = ["cones  area distortion E"]
        for each in found.sets:
            number = len(each.vertices)
            marks = ["knee"] * (number == found.knee) + [f"<= {wanted:g}"] * (each.distortion <= wanted)
            lines.append(f"{number:5d}  {each.distortion:.4f}  {', '.join(marks)}".rstrip())
    else:
        lines = [
            f"vertex {vertex:8d}  curvature {curvature / math.pi:+.4f} pi"
            for vertex, curvature in zip(chosen.vertices, chosen.curvatures, strict=True)
        ]
        lines.append(f"{len(chosen.vertices)} cones, area distortion {chosen.distortion:.4f}")
        if keywords["cone_count"] is None and chosen.distortion > keywords["distortion"] * (1 + 1e-9):
            lines.append(
                f"note: above the {keywords['distortion']:g} allowed: no better was found within the bounds given"
            )
    if not quiet:
        click.echo("\n".join(lines))
    if picture is not None:
        save_figure(make_figure(found, "curve", distortion=wanted, title=mesh.name), picture)
    if output is not None:
        with atomic_write(output, "w") as file:
            for vertex, curvature in zip(chosen.vertices, chosen.curvatures, strict=True):
                file.write(f"{vertex} {float(curvature)!r}\n")
    if not quiet:
        for path in (picture, output):
            if path is not None:
                click.echo(f"wrote {path}")
