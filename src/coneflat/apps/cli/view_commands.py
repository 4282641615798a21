"""`coneflat view` and `coneflat studio`: the pages in the browser."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from ...base import printable
from ...options import SHOWS
from .flags import (
    QUIET,
    again_option,
    color_option,
    flag,
    input_options,
    most_option,
    names_formats,
    option_flags,
    path_flag,
    pop_flags,
    up_option,
    verbosity_options,
)


@dataclass(frozen=True, kw_only=True)
class ViewFlags:
    """Output.

    Attributes:
        output: Page to write, .html.  [default: FILE's name with _view; it is opened in the browser]
        texture: Image for the model: PNG, JPEG, GIF or WebP.
        show: Display mode at the start.  [default: checker, or picture with --texture]
        unwrap: Unwrap the mesh for textures instead of flattening it or showing its UVs.
    """

    output: Path | None = path_flag()
    texture: Path | None = path_flag()
    show: str | None = flag(type=click.Choice(SHOWS))
    unwrap: bool = flag(False, is_flag=True)


@click.command(short_help="Show a mesh and its layout in the browser.")
@click.argument("file", type=click.Path(path_type=Path))
@option_flags(ViewFlags)
@color_option
@up_option
@again_option
@input_options
@most_option
@verbosity_options
@names_formats
def view(
    file: Path,
    color: str | None,
    again: bool,
    repair: bool,
    weld: bool | None,
    verbosity: str | None,
    **params: Any,
) -> None:
    """Write a page that shows FILE and its layout side by side.

    FILE is a mesh ({MESH}) or a result (.npz) of `coneflat flatten`,
    `coneflat unwrap` or `coneflat quads`. A mesh without UVs is flattened first, with default options. The page is a
    single HTML file.

    \b
    Examples:
      coneflat view horse.ply
      coneflat view horse_uv.obj --show qc
      coneflat view horse.ply --unwrap
      coneflat view horse.npz -o horse.html --show qc
      coneflat view scan.ply --color quality
      coneflat view hand.obj -o hand.html --texture leather.jpg
      coneflat quads hand.obj -o hand.npz && coneflat view hand.npz
    """
    from ... import flatten, unwrap
    from ...io import read_picture
    from ...quadmesh import holds_quads, read_quads
    from ..view import check_page, open_page, own_quantity, page_html, page_of_quads, write_page
    from .run import Console, archive_path, open_result

    # Errors that writing would raise are reported before the work starts.
    flags = pop_flags(params, ViewFlags)
    page = check_page(Path(f"{file.stem}_view.html") if flags.output is None else flags.output)
    if flags.unwrap and archive_path(file) is not None:
        raise click.UsageError(f"--unwrap needs a mesh, and {file.name} is a result: leave it out")
    if flags.texture is not None:
        read_picture(flags.texture)
    with Console(verbosity) as console:
        look = {"name": file.name, "texture": flags.texture, "show": flags.show, **params}
        result = None
        if holds_quads(file):
            if color is not None:
                raise click.UsageError("--color has no effect on quads: leave it out")
            with console.stage("read", 0.0):
                quads = read_quads(file)
            with console.stage("page"):
                text = page_of_quads(quads, **look)
        else:
            by, again = (unwrap, True) if flags.unwrap else (flatten, again)
            result = open_result(file, console, again=again, repair=repair, weld=weld, by=by)
            with console.stage("page"):
                if color is not None:
                    look["color"] = own_quantity(result, color, archive_path(file))
                text = page_html(result, **look)
        write_page(text, page)
        console.finish([page], result)
        if flags.output is None and not open_page(page):
            console.say(["open it in any browser"])


@click.command(short_help="Place cones and seams interactively in the browser.")
@click.argument("file", type=click.Path(path_type=Path), metavar="[MESH|PROJECT]", required=False)
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=0,
    show_default="a free port",
    help="Port of the page on this machine.",
)
@click.option("--no-open", is_flag=True, help="Print the address of the page without opening a browser.")
@color_option
@most_option
@verbosity_options
def studio(
    file: Path | None, port: int, no_open: bool, color: str | None, most_triangles: int, verbosity: str | None
) -> None:
    """Place cones and draw seams on a mesh in the browser, and see the layout immediately.

    The address of the page is printed first. It can be used on this machine only, and contains a secret token. A mesh
    can also be dropped on the page. The choices are saved in the current folder in a project, MESH's name with
    _studio.json, from which the studio can continue, and of which `coneflat flatten --project` or `coneflat unwrap
    --project` computes the same layout. Ctrl-C ends the studio, with exit code 0.

    \b
    Examples:
      coneflat studio hand.obj
      coneflat studio hand_studio.json
      coneflat studio --port 8000 --no-open
    """
    from ..studio.serve import run_studio

    def say(line: str) -> None:
        # Without a browser, the address is needed.
        if verbosity != QUIET or no_open:
            click.echo(line)

    project = run_studio(file, port, opens=not no_open, say=say, color=color, most_triangles=most_triangles)
    if verbosity != QUIET:
        place = f" Choices are in {printable(project)}." if project is not None and project.exists() else ""
        click.echo(f"Studio ended.{place}")
