"""`coneflat transfer`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from ...base import BAKED_RESOLUTION
from .shared_flags import uv_set_option, verbosity_options

if TYPE_CHECKING:
    from ..transfer import Baked

_PATH = click.Path(path_type=Path)


@click.command(short_help="Bake the textures of a model into other UVs.")
@click.argument("source", metavar="OLD", type=_PATH)
@click.argument("target", metavar="NEW", type=_PATH)
@click.option(
    "-o", "--output", type=_PATH, help="File to write: .glb or .png.  [default: NEW's name with _baked]"
)
@click.option(
    "--resolution", type=int, default=BAKED_RESOLUTION, show_default=True, help="Texels along a side."
)
@click.option("--texture", type=_PATH, help="Image of the UVs of OLD, instead of its materials.")
@uv_set_option
@verbosity_options
def transfer(
    source: Path,
    target: Path,
    output: Path | None,
    resolution: int,
    texture: Path | None,
    uv_set: int,
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
            baked = bake(source, target, resolution=resolution, texture=texture, uv_set=uv_set)
        with console.stage("write"):
            baked.save(output)
        losses = (*baked.losses(output), *_not_baked(baked, output))
        console.notes((*baked.notes, *losses))
        console.finish([output])


def _not_baked(baked: Baked, output: Path) -> tuple[str, ...]:
    """Return a note on data of a model that its file with baked textures does not keep; a picture is not the model."""
    from ... import io

    source, ending = baked.uv_mesh.source, output.suffix.lower()
    if source is None or ending not in io.OUTPUT_FORMATS:
        return ()
    # Baked textures replace them.
    replaced = {
        io.MATERIALS,
        io.Attribute("textures"),
        io.VERTEX_COLOURS,
        io.Attribute("vertex attributes", "COLOR_0"),
    }
    return io.losses(
        source, ending, io.kept_attributes(source, ending) | replaced | set(io.texture_files(source))
    )
