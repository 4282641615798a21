"""`coneflat view`."""

from __future__ import annotations

from pathlib import Path

import click


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
    type=click.Choice(["checker", "picture", "charts", "qc", "area", "curvature", "flat", "plain"]),
    help="What the page shows first.  [default: checker, or picture with --texture]",
)
@click.option(
    "--up",
    type=click.Choice(["x", "y", "z"]),
    default="y",
    show_default=True,
    help="The model's upward axis.",
)
@click.option(
    "--most-triangles",
    type=int,
    default=500_000,
    show_default=True,
    help="Thin a larger mesh to so many, for display only.",
)
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
def view(
    file: Path,
    output: Path | None,
    texture: Path | None,
    show: str | None,
    up: str,
    most_triangles: int,
    quiet: bool,
) -> None:
    """Write a page, one HTML file, that shows FILE and its layout side by side.

    FILE is a result, .npz as `coneflat flatten -o` writes it, or a mesh (.obj, .ply, .stl, .off, .gltf, .glb), which
    is flattened first with default options, without overlaps.

    \b
    Examples:
      coneflat view horse.ply
      coneflat view horse.npz -o horse.html --show qc
      coneflat view hand.obj -o hand.html --texture leather.jpg
    """
    from ..io import read_flattening, read_mesh
    from ..pipeline import flatten
    from ..stages import Stages
    from ..view.picture import read_picture
    from ..view.webpage import check_page, open_page, page_of, write_page
    from .console import Console

    # What can fail at the end is looked at before the work.
    page = check_page(Path(f"{file.stem}_view.html") if output is None else output)
    if texture is not None:
        read_picture(texture)
    with Console(quiet) as console:
        if file.suffix.lower() == ".npz":
            result = read_flattening(file)
        else:
            stages = Stages(console.progress)
            with stages("read"):
                source = read_mesh(file)
            result = flatten(source, charts="atlas", progress=console.progress)
        console.progress("page", 1.0)
        text = page_of(
            result, name=file.name, texture=texture, up=up, show=show, most_triangles=most_triangles
        )
        write_page(text, page)
        console.finish(result, [page])
    if output is None and not open_page(page) and not quiet:
        click.echo("open it in any browser")
