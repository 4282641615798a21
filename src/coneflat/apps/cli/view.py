"""`coneflat view`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ...options.outputs import MOST_TRIANGLES, SHOWS
from .shared import again_option, color_option, input_options, up_option, verbosity_options


@click.command(short_help="Show a mesh and its layout in the browser.")
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    help="Page to write, .html.  [default: FILE's name with _view, opened in the browser]",
)
@click.option(
    "--texture", type=click.Path(path_type=Path), help="PNG, JPEG, GIF or WebP picture to lay on the model."
)
@click.option(
    "--show",
    type=click.Choice(SHOWS),
    help="What the page shows first.  [default: checker, or picture with --texture]",
)
@color_option
@up_option
@again_option
@input_options
@click.option(
    "--most-triangles",
    type=int,
    default=MOST_TRIANGLES,
    show_default=True,
    help="Thin a larger mesh to so many, for display only.",
)
@verbosity_options
def view(
    file: Path,
    output: Path | None,
    texture: Path | None,
    show: str | None,
    color: str | None,
    up: str,
    again: bool,
    repair: bool,
    weld: bool | None,
    most_triangles: int,
    verbosity: str | None,
) -> None:
    """Write a page, one HTML file, that shows FILE and its layout side by side.

    FILE is a result, .npz as `coneflat flatten` writes it, quads, as `coneflat quads` does, or a mesh (.obj, .ply,
    .stl, .off, .gltf, .glb): the UVs that it has are shown; without, it is flattened first with default options,
    without overlaps.

    \b
    Examples:
      coneflat view horse.ply
      coneflat view horse_uv.obj --show qc
      coneflat view horse.npz -o horse.html --show qc
      coneflat view scan.ply --color quality
      coneflat view hand.obj -o hand.html --texture leather.jpg
      coneflat quads hand.obj -o hand.npz && coneflat view hand.npz
    """
    from ...files.quads import holds_quads, read_quads
    from ...files.texture import read_picture
    from ...view.own import own_quantity
    from ...view.page.quads import page_of_quads
    from ...view.page.webpage import check_page, open_page, page_of, write_page
    from .console import Console
    from .run import FLATTENED, archive_of, open_result

    # What can fail at the end is looked at before the work.
    page = check_page(Path(f"{file.stem}_view.html") if output is None else output)
    if texture is not None:
        read_picture(texture)
    with Console(verbosity) as console:
        look: dict[str, Any] = {
            "name": file.name,
            "texture": texture,
            "up": up,
            "show": show,
            "most_triangles": most_triangles,
        }
        result = None
        if holds_quads(file):
            if color is not None:
                raise click.UsageError("quads are shown without colours of your own: leave out --color")
            with console.stage("read", 0.0):
                quads = read_quads(file)
            with console.stage("page", FLATTENED):
                text = page_of_quads(quads, **look)
        else:
            result = open_result(file, console, again=again, repair=repair, weld=weld)
            with console.stage("page", FLATTENED):
                if color is not None:
                    look["color"] = own_quantity(result, color, archive_of(file))
                text = page_of(result, **look)
        write_page(text, page)
        console.finish([page], result)
        if output is None and not open_page(page):
            console.say(["open it in any browser"])
