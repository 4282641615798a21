"""`coneflat flatten` and `coneflat unwrap`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ...options import Options, declarations
from ...textures import UnwrapOptions
from .checks import check_combinations, check_required, is_given
from .flags import flag, flag_name, keywords, option_flags, path_flag, pop_flags
from .grouped_help import GroupedCommand, names_formats
from .shared_flags import FORMAT_CHOICE, input_options, paper_option, require_option, verbosity_options

if TYPE_CHECKING:
    from ... import Flattening


@dataclass(frozen=True, kw_only=True)
class FileFlags:
    """Output.

    Attributes:
        output: File to write: {FLATTENING}; - for standard output.  [default: MESH's name with _uv, as
            .obj; - if MESH is -]
        format: Format for standard output, or if -o is not given.  [default: obj]
        texture: Texture of a .glb: a checkerboard, or an image file.
        uv_set: 1: write the UVs as a second set, TEXCOORD_1, beside those of the textures, which remain; {UV_SETS}
            only. 0: replace those of the textures.  [default: 0; with --lightmap 1 if the format has it]
        report: JSON file for all measures.
        project: Project of `coneflat studio` (.json) with the mesh and the options.
    """

    output: Path | None = path_flag()
    format: str | None = flag(type=FORMAT_CHOICE)
    texture: str | None = flag(metavar="checker|IMAGE")
    uv_set: int | None = flag(type=click.IntRange(0, 1))
    report: Path | None = path_flag()
    project: Path | None = path_flag()


@click.command(
    cls=GroupedCommand,
    short_help="Flatten a mesh and write it with UV coordinates.",
    context_settings={"allow_extra_args": True},
)
@click.argument("mesh", type=click.Path(path_type=Path), required=False)
@option_flags(FileFlags)
@paper_option
@option_flags(Options)
@input_options
@require_option
@verbosity_options
@click.pass_context
@names_formats
def flatten(context: click.Context, /, **params: Any) -> None:
    """Flatten MESH and write it with UV coordinates.

    MESH is a file ({MESH}), or - for standard input.

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
            f"expected one mesh, got {1 + len(context.args)}: `coneflat batch "
            f"{params['mesh']} {context.args[0]} ... --out FOLDER` flattens many",
            context,
        )
    from ... import flatten as find

    check_combinations(context)
    _flatten_and_save(context, find, Options, **params)


@click.command(cls=GroupedCommand, short_help="Unwrap a mesh for textures, with short seams.")
@click.argument("mesh", type=click.Path(path_type=Path), required=False)
@option_flags(FileFlags)
@option_flags(UnwrapOptions)
@input_options
@require_option
@verbosity_options
@click.pass_context
@names_formats
def unwrap(context: click.Context, /, **params: Any) -> None:
    """Write MESH with UV coordinates for a texture: nearly isometric, with the shortest seams.

    MESH is a file ({MESH}), or - for standard input.

    \b
    Examples:
      coneflat unwrap horse.ply -o horse.glb
      coneflat unwrap hand.obj -o hand.obj --max-energy 4.05 --resolution 2048
      coneflat unwrap --project hand_studio.json -o hand.glb
    """
    from ... import unwrap as find

    _flatten_and_save(context, find, UnwrapOptions, **params)


def _flatten_and_save(
    context: click.Context,
    by: Callable[..., Flattening],
    group: type,
    *,
    mesh: Path | None,
    required: tuple[str, ...],
    weld: bool | None,
    verbosity: str | None,
    **params: Any,
) -> None:
    """Flatten a file by a function with a group of options, and write the result and its report."""
    from ...io import PIPE, check_output, check_target
    from ...measures import REPORTED, parse_requirements
    from .run import Console, flatten_file, redirect_prints, require_distinct, save

    flags, add_notes = pop_flags(params, FileFlags), None
    if flags.project is not None:
        mesh, options, add_notes = _project_arguments(context, flags.project, group)
    elif mesh is None:
        raise click.MissingParameter(ctx=context, param_hint="'MESH'", param_type="argument")
    else:
        options = keywords(params, group)
    requirements = parse_requirements(required, REPORTED)
    ending = f".{flags.format or 'obj'}"
    output = flags.output or (PIPE if mesh == PIPE else Path(f"{mesh.stem}_uv{ending}"))
    if flags.format is not None and output.suffix.lower() not in ("", ending):
        raise click.UsageError(f"{output} is not a {ending} file: leave out --format", context)
    # Errors that writing would raise are reported before the work starts.
    check_output(Path(f"stdout{ending}") if output == PIPE else output, flags.texture, flags.uv_set)
    if flags.report is not None:
        check_target(flags.report)
    require_distinct({"input": mesh, "output": output, "report": flags.report})
    with redirect_prints(output) as stdout, Console(verbosity) as console:
        result = flatten_file(mesh, console, options, weld, by)
        result = result if add_notes is None else add_notes(result)
        result = save(result, console, output, flags.report, flags.texture, stdout, ending, flags.uv_set)
        written = [path for path in (output, flags.report) if path is not None and path != PIPE]
        console.finish(written, result)
    check_required(requirements, result.report(), str(output))


def _project_arguments(
    context: click.Context, project: Path, group: type
) -> tuple[Path, dict[str, Any], Callable[[Flattening], Flattening]]:
    """Return the mesh of a project, its options of a group, and a function that adds its notes."""
    from ..studio.messages import with_warnings
    from ..studio.project import read_project

    for name in (*declarations(group), "mesh", "paper", "weld"):
        if name in context.params and is_given(context, name):
            argument = "MESH" if name == "mesh" else flag_name(name)
            raise click.UsageError(f"a project contains mesh and options: leave out {argument}", context)
    opened = read_project(project)
    opened.check_mesh()
    choices = opened.choices.with_texture(group is UnwrapOptions)
    return (
        opened.mesh,
        choices.keywords(),
        lambda result: with_warnings(choices.used_pins.applied(result), choices),
    )
