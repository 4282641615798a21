"""`coneflat demo`."""

from __future__ import annotations

from pathlib import Path

import click


@click.command(short_help="Flatten a sample model, and draw it.")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    default=Path("coneflat-demo"),
    show_default=True,
    help="Folder to write to; made if it is missing.",
)
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
def demo(output: Path, quiet: bool) -> None:
    """Flatten the sample that comes with coneflat; write the textured mesh, its report and a picture."""
    from ..errors import MeshFileError
    from ..sample import sample_path
    from ..view import demo_figure, new_figure, save_figure
    from .run import run

    new_figure(1, 1)  # says what is missing before the work
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise MeshFileError(f"cannot make the folder {output}: {error.strerror}") from error
    result = run(
        sample_path(), output / "sample.obj", {"charts": "atlas"}, report=output / "sample.json", quiet=quiet
    )

    picture = output / "sample.png"
    save_figure(demo_figure(result), picture)
    if not quiet:
        click.echo(f"wrote {picture}\n\nNow try your own:  coneflat flatten MESH -o OUT.obj")
