"""`coneflat flatten`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ...options import Options, declarations
from ...options.outputs import FORMATS
from .options import check_combinations, flag_of, is_given, keywords, option_flags, paper_option
from .shared import checking, input_options, measures_alone, require_option, verbosity_options

if TYPE_CHECKING:
    from ...result.flattening import Flattening


@click.command(
    short_help="Flatten a mesh and write it with UV coordinates.",
    context_settings={"allow_extra_args": True},
)
@click.argument("mesh", type=click.Path(path_type=Path), required=False)
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
    type=click.Choice(FORMATS),
    help="Of standard output, and without -o: what to write.  [default: obj]",
)
@paper_option
@option_flags(Options, one_mesh=True)
@input_options
@require_option
@click.option(
    "--texture",
    metavar="checker|IMAGE",
    help="Of a .glb: the texture that it carries, a checkerboard or an image file.",
)
@click.option(
    "--project",
    type=click.Path(path_type=Path),
    help="In place of MESH and of all that says how it is flattened: a project of `coneflat studio`, .json.",
)
@click.option("--report", type=click.Path(path_type=Path), help="Write all measures to this JSON file.")
@verbosity_options
@click.pass_context
def flatten(
    context: click.Context,
    /,
    mesh: Path | None,
    output: Path | None,
    form: str | None,
    required: tuple[str, ...],
    repair: bool,
    weld: bool | None,
    texture: str | None,
    project: Path | None,
    report: Path | None,
    verbosity: str | None,
    **method: Any,
) -> None:
    """Flatten MESH (.obj, .ply, .stl, .off, .gltf, .glb; - for standard input) and write it with UV coordinates.

    \b
    Examples:
      coneflat flatten horse.ply -o horse.obj
      coneflat flatten hand.obj -o hand.glb --distortion 0.1 --texture checker
      coneflat flatten part.stl --cones 12,507,1044
      coneflat flatten bracket.stl -o bracket.obj --sharp-angle 40deg
      coneflat flatten sheet.obj -o flat.obj --boundary 10,95,230,310
      coneflat flatten --project hand_studio.json -o hand.glb
      curl -s https://example.org/part.stl | coneflat flatten - -o - --format glb > part.glb
    """
    if context.args:
        raise click.UsageError(
            f"flatten takes one mesh, and there are {1 + len(context.args)}: `coneflat batch "
            f"{mesh} {context.args[0]} ... --out FOLDER` flattens many",
            context,
        )
    from ...result.requirements import REPORTED, parse_requirements
    from .run import named_output, run

    requirements = parse_requirements(measures_alone(required), REPORTED)
    check_combinations(context)
    noted = None
    if project is not None:
        mesh, options, noted = of_project(context, project)
    elif mesh is None:
        raise click.MissingParameter(ctx=context, param_hint="'MESH'", param_type="argument")
    else:
        options = {**keywords(method), **checking(repair)}
    ending = f".{form or 'obj'}"
    output = named_output(mesh, ending) if output is None else output
    if form is not None and output.suffix.lower() not in ("", ending):
        raise click.UsageError(f"{output} is no {ending} file: leave out --format", context)
    run(
        mesh,
        output,
        options,
        weld=weld,
        report=report,
        texture=texture,
        verbosity=verbosity,
        ending=ending,
        requirements=requirements,
        noted=noted,
    )


def of_project(
    context: click.Context, project: Path
) -> tuple[Path, dict[str, Any], Callable[[Flattening], Flattening]]:
    """Return the mesh of a project, the keyword arguments of `coneflat.flatten` that it holds, and what notes them."""
    from ..studio.project import read_project
    from ..studio.warnings import noted

    taken = [name for name in (*declarations(Options), "mesh", "paper", "weld") if name in context.params]
    for name in taken:
        if is_given(context, name):
            what = "MESH" if name == "mesh" else flag_of(name)
            raise click.UsageError(f"a project has its own mesh and options: leave out {what}", context)
    opened = read_project(project)
    opened.check_mesh()
    return opened.mesh, opened.choices.keywords(), lambda result: noted(result, opened.choices)
