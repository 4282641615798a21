"""`coneflat flatten`, `coneflat unwrap` and `coneflat transfer`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ...options import FORMATS, Options, declarations
from ..unwrap.options import UnwrapOptions
from .options import (
    check_combinations,
    flag,
    flag_name,
    is_given,
    keywords,
    option_flags,
    paper_option,
    path_flag,
    pop_flags,
)
from .shared import GroupedCommand, check_required, input_options, require_option, verbosity_options

if TYPE_CHECKING:
    from ... import Flattening


@dataclass(frozen=True, kw_only=True)
class FileFlags:
    """Output.

    Attributes:
        output: File to write: .obj, .ply, .glb or .npz; - for standard output.  [default: MESH's name with _uv, as
            .obj; - if MESH is -]
        format: Format for standard output, or if -o is not given.  [default: obj]
        texture: Texture of a .glb: a checkerboard, or an image file.
        report: JSON file for all measures.
    """

    output: Path | None = path_flag()
    format: str | None = flag(type=click.Choice(FORMATS))
    texture: str | None = flag(metavar="checker|IMAGE")
    report: Path | None = path_flag()


@dataclass(frozen=True, kw_only=True)
class FlattenFlags(FileFlags):
    """Output.

    Attributes:
        project: Project of `coneflat studio` (.json) to flatten instead of MESH.
    """

    project: Path | None = path_flag()


@click.command(
    cls=GroupedCommand,
    short_help="Flatten a mesh and write it with UV coordinates.",
    context_settings={"allow_extra_args": True},
)
@click.argument("mesh", type=click.Path(path_type=Path), required=False)
@option_flags(FlattenFlags)
@paper_option
@option_flags(Options)
@input_options
@require_option
@verbosity_options
@click.pass_context
def flatten(
    context: click.Context,
    /,
    mesh: Path | None,
    required: tuple[str, ...],
    weld: bool | None,
    verbosity: str | None,
    **given: Any,
) -> None:
    """Flatten MESH and write it with UV coordinates.

    MESH is a file (.obj, .ply, .stl, .off, .gltf, .glb), or - for standard input.

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
            f"{mesh} {context.args[0]} ... --out FOLDER` flattens many",
            context,
        )
    from ... import flatten as find

    check_combinations(context)
    flags, add_notes = pop_flags(given, FlattenFlags), None
    if flags.project is not None:
        mesh, options, add_notes = project_arguments(context, flags.project)
    elif mesh is None:
        raise click.MissingParameter(ctx=context, param_hint="'MESH'", param_type="argument")
    else:
        options = keywords(given)
    _flatten_and_save(context, mesh, flags, options, required, weld, verbosity, find, add_notes)


@click.command(cls=GroupedCommand, short_help="Unwrap a mesh for textures, with short seams.")
@click.argument("mesh", type=click.Path(path_type=Path))
@option_flags(FileFlags)
@option_flags(UnwrapOptions)
@input_options
@require_option
@verbosity_options
@click.pass_context
def unwrap(
    context: click.Context,
    /,
    mesh: Path,
    required: tuple[str, ...],
    weld: bool | None,
    verbosity: str | None,
    **given: Any,
) -> None:
    """Write MESH with UV coordinates for a texture: nearly isometric, with the shortest seams.

    MESH is a file (.obj, .ply, .stl, .off, .gltf, .glb), or - for standard input.

    \b
    Examples:
      coneflat unwrap horse.ply -o horse.glb
      coneflat unwrap hand.obj -o hand.obj --max-energy 4.05 --resolution 2048
    """
    from ... import unwrap as find

    flags, options = pop_flags(given, FileFlags), keywords(given, UnwrapOptions)
    _flatten_and_save(context, mesh, flags, options, required, weld, verbosity, find)


def _flatten_and_save(
    context: click.Context,
    mesh: Path,
    flags: FileFlags,
    options: dict[str, Any],
    required: tuple[str, ...],
    weld: bool | None,
    verbosity: str | None,
    by: Callable[..., Flattening],
    add_notes: Callable[[Flattening], Flattening] | None = None,
) -> None:
    """Flatten a file by a function, and write the result and its report."""
    from ...io import PIPE, check_output, check_target
    from ...measure import REPORTED, parse_requirements
    from .run import Console, flatten_file, redirect_prints, require_distinct, save

    requirements = parse_requirements(required, REPORTED)
    ending = f".{flags.format or 'obj'}"
    output = flags.output or (PIPE if mesh == PIPE else Path(f"{mesh.stem}_uv{ending}"))
    if flags.format is not None and output.suffix.lower() not in ("", ending):
        raise click.UsageError(f"{output} is not a {ending} file: leave out --format", context)
    # Errors that writing would raise are reported before the work starts.
    check_output(Path(f"stdout{ending}") if output == PIPE else output, flags.texture)
    if flags.report is not None:
        check_target(flags.report)
    require_distinct({"input": mesh, "output": output, "report": flags.report})
    with redirect_prints(output) as stdout, Console(verbosity) as console:
        result = flatten_file(mesh, console, options, weld, by)
        result = result if add_notes is None else add_notes(result)
        result = save(result, console, output, flags.report, flags.texture, stdout, ending)
        written = [path for path in (output, flags.report) if path is not None and path != PIPE]
        console.finish(written, result)
    check_required(requirements, result.report(), str(output))


def project_arguments(
    context: click.Context, project: Path
) -> tuple[Path, dict[str, Any], Callable[[Flattening], Flattening]]:
    """Return the mesh of a project, its keyword arguments of `coneflat.flatten`, and a function that adds its notes."""
    from ..studio.messages import with_warnings
    from ..studio.project import read_project

    for name in (*declarations(Options), "mesh", "paper", "weld"):
        if name in context.params and is_given(context, name):
            what = "MESH" if name == "mesh" else flag_name(name)
            raise click.UsageError(f"a project contains mesh and options: leave out {what}", context)
    opened = read_project(project)
    opened.check_mesh()
    return opened.mesh, opened.choices.keywords(), lambda result: with_warnings(result, opened.choices)


_PATH = click.Path(path_type=Path)


@click.command(short_help="Bake the textures of a model into other UVs.")
@click.argument("old", type=_PATH)
@click.argument("new", type=_PATH)
@click.option(
    "-o", "--output", type=_PATH, help="File to write: .glb or .png.  [default: NEW's name with _baked]"
)
@click.option("--resolution", type=int, default=2048, show_default=True, help="Texels along a side.")
@click.option("--texture", type=_PATH, help="Image of the UVs of OLD, instead of its materials.")
@verbosity_options
def transfer(
    old: Path,
    new: Path,
    output: Path | None,
    resolution: int,
    texture: Path | None,
    verbosity: str | None,
) -> None:
    """Bake the textures or vertex colours of OLD into the UVs of NEW, a model of the same shape.

    Colours continue around the charts. A .png gets the base colour only.

    \b
    Examples:
      coneflat unwrap chair.glb -o chair_uv.glb
      coneflat transfer chair.glb chair_uv.glb -o chair_baked.glb
    """
    from ... import io
    from ..transfer import ENDINGS
    from ..transfer import transfer as bake
    from .run import Console, require_distinct

    output = output or Path(f"{new.stem}_baked.glb")
    io.checked_target(output, ENDINGS, "textures are written as")
    require_distinct({"old model": old, "new model": new, "texture": texture, "output": output})
    with Console(verbosity) as console:
        with console.stage("bake", 0.0):
            baked = bake(old, new, resolution=resolution, texture=texture)
        with console.stage("write"):
            baked.save(output)
        console.say(f"note: {note}" for note in baked.notes)
        console.finish([output])
