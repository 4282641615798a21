"""The commands of further applications: `coneflat brain`, `coneflat transfer` and `coneflat blender`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ...base import plural
from ...options import FORMATS, ConeNumber, Direction, RunOptions, option, strength
from .measure import rows_of_measures
from .options import flag, keywords, option_flags, path_flag, pop_flags
from .shared import GroupedCommand, verbosity_options

if TYPE_CHECKING:
    from ..transfer import Baked

_PATH = click.Path(path_type=Path)


@dataclass(frozen=True, kw_only=True)
class BrainOptions(ConeNumber, RunOptions):
    """Cones.

    Attributes:
        stretch: Trade-off between angles (0) and distances (1).
        up: Direction of the surface that points up in the flat map, superior by default.
    """

    stretch: float = option(1.0, strength(1.0))
    up: tuple[float, float, float] | None = option(None, Direction())


@dataclass(frozen=True, kw_only=True)
class BrainFlags:
    """Output.

    Attributes:
        output: File to write: a GIFTI surface (.gii), a FreeSurfer patch (.3d), or a result (.npz, .obj, .ply, .glb),
            which view and figure show; repeat for several.  [default: SURFACE's name with .flat.gii]
        remove_label: Label to cut off, such as the medial wall: FILE.label, or FILE:NAME for an .annot or a label .gii;
            repeat for several.
        keep_label: Label that no cut crosses.
        report: JSON file for all measures.
    """

    output: tuple[Path, ...] = flag((), type=click.Path(path_type=Path), multiple=True)
    remove_label: tuple[str, ...] = flag((), multiple=True, metavar="LABEL")
    keep_label: tuple[str, ...] = flag((), multiple=True, metavar="LABEL")
    report: Path | None = path_flag()


@click.command(cls=GroupedCommand, short_help="Make a flat map of a brain's cortex.")
@click.argument("surface", type=click.Path(path_type=Path))
@option_flags(BrainFlags)
@option_flags(BrainOptions)
@verbosity_options
@click.pass_context
def brain(context: click.Context, /, surface: Path, verbosity: str | None, **params: Any) -> None:
    """Make a flat map of SURFACE, the cortex of one hemisphere (.gii, or FreeSurfer's lh.pial).

    \b
    Examples:
      coneflat brain lh.pial --remove-label lh.aparc.annot:unknown -o lh.flat.gii
      coneflat brain lh.white --remove-label lh.Medial_wall.label -o lh.flat.patch.3d -o lh.npz
      coneflat figure lh.npz --color lh.sulc
      coneflat measure lh.flat.gii --surface lh.white
    """
    from ...io import as_written, check_target, checked_target, losses
    from ..brains import FLAT_FORMATS, flatten_cortex, kept_in_flat, measure_flat
    from .run import Console, require_distinct, write_report

    flags, options = pop_flags(params, BrainFlags), keywords({**params, "repair": True}, BrainOptions)
    outputs = flags.output or (Path(f"{surface.name}.flat.gii"),)
    formats = (*FLAT_FORMATS, *(f".{name}" for name in FORMATS))
    for path in outputs:
        checked_target(path, formats, "flat maps are written as")
    if flags.report is not None:
        check_target(flags.report)
    require_distinct({"surface": surface, "report": flags.report, **{str(path): path for path in outputs}})
    with Console(verbosity) as console:
        cortex = flatten_cortex(
            surface, remove=flags.remove_label, keep=flags.keep_label, progress=console.part(), **options
        )
        console.seconds.update(cortex.result.seconds)
        with console.stage("write"):
            for path in outputs:
                (cortex if path.suffix.lower() in FLAT_FORMATS else cortex.result).save(path)
        # The file for FreeSurfer leaves out the most triangles.
        smallest = next((path for path in outputs if path.suffix.lower() == ".3d"), Path(".gii"))
        with console.stage("measure"):
            measured = measure_flat(cortex.uv_mesh(smallest))
        if flags.report is not None:
            write_report(flags.report, {**measured.report(), "seconds": dict(console.seconds)})
        left_out = len(cortex.result.faces) - int(measured.uv.counts["triangles"])
        along = [f"{plural(left_out, 'triangle')} along cuts left out of the flat map."] if left_out else []
        notes = [*cortex.result.notes, *measured.uv.notes, *along]
        for ending in dict.fromkeys(path.suffix.lower() for path in outputs):
            if ending in FLAT_FORMATS:
                notes += losses(cortex.surface, ending, kept_in_flat(cortex.surface, ending))
            else:
                notes += as_written(cortex.result, ending).notes
        console.say(f"note: {note}" for note in dict.fromkeys(notes))
        console.finish([*outputs, *([] if flags.report is None else [flags.report])])
        console.table(rows_of_measures(measured.uv, measured))


@click.command(short_help="Bake the textures of a model into other UVs.")
@click.argument("source", metavar="OLD", type=_PATH)
@click.argument("target", metavar="NEW", type=_PATH)
@click.option(
    "-o", "--output", type=_PATH, help="File to write: .glb or .png.  [default: NEW's name with _baked]"
)
@click.option("--resolution", type=int, default=2048, show_default=True, help="Texels along a side.")
@click.option("--texture", type=_PATH, help="Image of the UVs of OLD, instead of its materials.")
@verbosity_options
def transfer(
    source: Path,
    target: Path,
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

    output = output or Path(f"{target.stem}_baked.glb")
    io.checked_target(output, ENDINGS, "textures are written as")
    require_distinct({"old model": source, "new model": target, "texture": texture, "output": output})
    with Console(verbosity) as console:
        with console.stage("bake", 0.0):
            baked = bake(source, target, resolution=resolution, texture=texture)
        with console.stage("write"):
            baked.save(output)
        losses = (*baked.losses(output), *_not_baked(baked, output))
        console.say(f"note: {note}" for note in (*baked.notes, *losses))
        console.finish([output])


def _not_baked(baked: Baked, output: Path) -> tuple[str, ...]:
    """Return a note on data of a model that its file with baked textures does not keep; a picture is not the model."""
    from ... import io

    source, ending = baked.uv_mesh.source, output.suffix.lower()
    if source is None or ending not in io.KEPT:
        return ()
    # Baked textures replace them.
    replaced = {
        io.MATERIALS,
        io.Attribute("textures"),
        io.VERTEX_COLOURS,
        io.Attribute("vertex attributes", "COLOR_0"),
    }
    return io.losses(source, ending, io.KEPT[ending](source) | replaced | set(io.texture_files(source)))


@click.command(short_help="Write the Blender extension.")
@click.option(
    "-o",
    "--output",
    type=_PATH,
    default="coneflat_blender.zip",
    show_default=True,
    help="File to write, .zip.",
)
def blender(output: Path) -> None:
    """Write the extension for Blender 4.2 or later as a zip.

    Blender installs it by Edit > Preferences > Get Extensions > Install from Disk, or when it is dropped on its window.
    The commands are then in the menu UV, and in the tab coneflat of the sidebar.

    \b
    Example:
      coneflat blender -o coneflat_blender.zip
    """
    from ..blender import build_extension

    click.echo(f"wrote {build_extension(output)}")
