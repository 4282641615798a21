"""`coneflat view` and `coneflat studio`: the pages in the browser."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ...base import printable
from ...options import SHOWS
from .flags import flag, option_flags, path_flag, pop_flags
from .grouped_help import names_formats
from .shared_flags import (
    QUIET,
    again_option,
    color_option,
    input_options,
    most_option,
    up_option,
    verbosity_options,
)

if TYPE_CHECKING:
    from ... import Flattening
    from ...quadmesh import QuadMesh
    from .run import Console


@dataclass(frozen=True, kw_only=True)
class ViewFlags:
    """Output.

    Attributes:
        output: Page to write, .html.  [default: FILE's name with _view; it is opened in the browser]
        texture: Image for the model: PNG, JPEG, GIF or WebP.
        show: Display mode at the start.  [default: checker, or picture with --texture or a texture of the file]
        qc_max: QC distortion at the end of its colour scale, so that pages can be compared.  [default: fits the values]
        scale_max: Scale at the end of its colour scale, which begins at the reciprocal.  [default: fits the values]
        unwrap: Unwrap the mesh for textures instead of flattening it or showing its UVs.
    """

    output: Path | None = path_flag()
    texture: Path | None = path_flag()
    show: str | None = flag(type=click.Choice(SHOWS))
    qc_max: float | None = flag(type=float)
    scale_max: float | None = flag(type=float)
    unwrap: bool = flag(False, is_flag=True)


@click.command(short_help="Show a mesh and its layout in the browser, or compare two.")
@click.argument("file", type=click.Path(path_type=Path))
@click.argument("second", type=click.Path(path_type=Path), required=False)
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
    second: Path | None,
    color: str | None,
    again: bool,
    repair: bool,
    weld: bool | None,
    verbosity: str | None,
    **params: Any,
) -> None:
    """Write a page that shows FILE and its layout side by side.

    FILE is a mesh ({MESH}) or a result (.npz) of `coneflat flatten`,
    `coneflat unwrap` or `coneflat quads`. A mesh without UVs is flattened first, with default options. With a second
    file, SECOND, the page shows both, with linked views. The page is a single HTML file.

    \b
    Examples:
      coneflat view horse.ply
      coneflat view horse_uv.obj --show faults
      coneflat view old.glb new.glb
      coneflat view horse.ply --unwrap
      coneflat view horse.npz -o horse.html --show qc --qc-max 1.5
      coneflat view scan.ply --color quality
      coneflat view hand.obj -o hand.html --texture leather.jpg
      coneflat quads hand.obj -o hand.npz && coneflat view hand.npz
    """
    from ... import Flattening, flatten, unwrap
    from ...io import read_picture
    from ..view import Ranges, check_page, common_ranges, comparison_html, open_page, write_page
    from .run import Console

    # Errors that writing would raise are reported before the work starts.
    flags = pop_flags(params, ViewFlags)
    files = [file] if second is None else [file, second]
    page = check_page(_default_page(files) if flags.output is None else flags.output)
    for path in files:
        _check_kinds(path, flags.unwrap, color)
    if flags.texture is not None:
        read_picture(flags.texture)
    look: dict[str, Any] = {"texture": flags.texture, "show": flags.show, **params}
    ranges = Ranges(flags.qc_max, flags.scale_max)
    read: dict[str, Any] = {"again": again or flags.unwrap, "repair": repair, "weld": weld}
    read |= {"by": unwrap if flags.unwrap else flatten}
    with Console(verbosity) as console:
        results = [_open(path, console, **read) for path in files]
        with console.stage("page"):
            maps = [result for result in results if isinstance(result, Flattening)]
            look["ranges"] = common_ranges(maps, ranges) if len(maps) > 1 else ranges
            names = [path.name if second is None or file.name != second.name else str(path) for path in files]
            pages = [
                _page(path, result, color, {**look, "name": name})
                for path, result, name in zip(files, results, names, strict=True)
            ]
            text = pages[0] if second is None else comparison_html(*pages, names=(names[0], names[1]))
        write_page(text, page)
        console.finish([page], maps[0] if maps and second is None else None)
        if flags.output is None and not open_page(page):
            console.say(["open it in any browser"])


def _default_page(files: list[Path]) -> Path:
    """Return the path of the page of one file, or of two."""
    return Path(f"{'_'.join(path.stem for path in files)}_view.html")


def _check_kinds(path: Path, unwrap: bool, color: str | None) -> None:
    """Raise UsageError if options have no effect on the kind of a file."""
    from ...quadmesh import holds_quads
    from .run import archive_path

    if unwrap and archive_path(path) is not None:
        raise click.UsageError(f"--unwrap needs a mesh, and {path.name} is a result: leave it out")
    if color is not None and holds_quads(path):
        raise click.UsageError("--color has no effect on quads: leave it out")


def _open(path: Path, console: Console, **read: Any) -> Flattening | QuadMesh:
    """Return the quads in a file, or the result of `open_result`."""
    from ...quadmesh import holds_quads, read_quads
    from .run import open_result

    if not holds_quads(path):
        return open_result(path, console, **read)
    with console.stage("read", 0.0):
        return read_quads(path)


def _page(path: Path, shown: Flattening | QuadMesh, color: str | None, look: Mapping[str, Any]) -> str:
    """Return the page of a result or of quads."""
    from ...quadmesh import QuadMesh
    from ..transfer import own_picture
    from ..view import own_quantity, page_html, page_of_quads
    from .run import archive_path

    if isinstance(shown, QuadMesh):
        return page_of_quads(shown, **look)
    further: dict[str, Any] = {}
    if color is not None:
        further["color"] = own_quantity(shown, color, archive_path(path))
    if look["texture"] is None and shown.source is not None and shown.face_corners is not None:
        further["own_picture"] = own_picture(shown.source)
    return page_html(shown, **look, **further)


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
