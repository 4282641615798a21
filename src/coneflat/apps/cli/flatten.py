"""`coneflat flatten`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from .method import check_combinations, method_keywords, method_options
from .search import forbidding_options
from .shared import NOT_MET, numbers_among, talk_options


@click.command(
    short_help="Flatten a mesh and write it with UV coordinates.",
    context_settings={"allow_extra_args": True},
)
@click.argument("mesh", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    help="File to write: .obj, .ply, .glb or .npz; - for standard output.  [default: MESH's name with _uv, as .obj; of "
    "standard input -]",
)
@click.option(
    "--format",
    "form",
    type=click.Choice(["obj", "ply", "glb", "npz"]),
    help="Of standard output, and without -o: what to write.  [default: obj]",
)
@method_options
@click.option(
    "--require",
    "required",
    metavar="VERTEX|MEASURE=VALUE",
    multiple=True,
    help="Make this vertex a cone; or exit with code "
    f"{NOT_MET} unless measures of the report are so: flipped=0,overlap=0 or qc_mean<=1.05; repeat for more.",
)
@forbidding_options
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
    "--corner",
    metavar="VERTEX[:CURVATURE]",
    multiple=True,
    help="Exact metric: a polygon with this boundary vertex as a corner; repeat: four make a rectangle.",
)
@click.option(
    "--seams",
    type=click.Path(path_type=Path),
    help="Cut the edges of a text file in any case, two vertices (from 0) on each line.",
)
@click.option(
    "--forbidden-seams",
    type=click.Path(path_type=Path),
    help="Do not cut the edges of a text file, two vertices on each line.",
)
@click.option(
    "--texture",
    metavar="checker|IMAGE",
    help="Of a .glb: the texture that it carries, a checkerboard or an image file.",
)
@click.option("--report", type=click.Path(path_type=Path), help="Write all measures to this JSON file.")
@talk_options
@click.pass_context
def flatten(
    context: click.Context,
    /,
    mesh: Path,
    output: Path | None,
    form: str | None,
    required: tuple[str, ...],
    cone: tuple[str, ...],
    cones_file: Path | None,
    corner: tuple[str, ...],
    seams: Path | None,
    forbidden_seams: Path | None,
    weld: bool | None,
    texture: str | None,
    report: Path | None,
    talk: str | None,
    **method: Any,
) -> None:
    """Flatten MESH (.obj, .ply, .stl, .off, .gltf, .glb; - for standard input) and write it with UV coordinates.

    \b
    Examples:
      coneflat flatten horse.ply -o horse.obj
      coneflat flatten hand.obj -o hand.glb --distortion 0.1 --texture checker
      coneflat flatten part.stl --cone 12 --cone 507 --cone 1044
      coneflat flatten bracket.stl -o bracket.obj --sharp-angle 40deg
      coneflat flatten sheet.obj -o flat.obj --corner 10 --corner 95 --corner 230 --corner 310
      curl -s https://example.org/part.stl | coneflat flatten - -o - --format glb > part.glb
    """
    if context.args:
        raise click.UsageError(
            f"flatten takes one mesh, and there are {1 + len(context.args)}: `coneflat batch "
            f"{mesh} {context.args[0]} ... --out FOLDER` flattens many",
            context,
        )
    method["require"], texts = numbers_among(required)
    if method["require"]:
        context.set_parameter_source("require", ParameterSource.COMMANDLINE)

    from ...result.requirements import REPORTED, parse_requirements
    from .given import parse_vertices, read_pairs
    from .run import named_output, run

    requirements = parse_requirements(texts, REPORTED)
    check_combinations(context)
    ending = f".{form or 'obj'}"
    output = named_output(mesh, ending) if output is None else output
    if form is not None and output.suffix.lower() not in ("", ending):
        raise click.UsageError(f"{output} is no {ending} file: leave out --format", context)
    options = method_keywords(method, output.suffix.lower() or ending)
    given = parse_vertices("cone", cone, cones_file)
    corners = parse_vertices("corner", corner)
    if given:
        options["cones"] = given
    if seams is not None:
        if method["keep_seams"]:
            raise click.UsageError(
                "seams are those of a file or of the input: leave out --keep-seams", context
            )
        options["seams"] = read_pairs(seams)
    if forbidden_seams is not None:
        options["forbidden_seams"] = read_pairs(forbidden_seams)
    if corners:
        options["boundary"] = corners
    run(
        mesh,
        output,
        options,
        weld=weld,
        report=report,
        texture=texture,
        talk=talk,
        ending=ending,
        requirements=requirements,
    )
