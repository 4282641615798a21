"""`coneflat demo`."""

from __future__ import annotations

from pathlib import Path

import click

from .shared import verbosity_options

DRAWING = 0.95  # The fraction of the whole that is done before.


@click.command(short_help="Flatten a sample model, and draw it.")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    default=Path("coneflat-demo"),
    show_default=True,
    help="Folder to write to; made if it is missing.",
)
@verbosity_options
def demo(output: Path, verbosity: str | None) -> None:
    """Flatten the sample that comes with coneflat; write the textured mesh, its report and a picture."""
    from ...files.atomic import make_folder
    from ...sample import sample_path
    from ...view import demo_figure, new_figure, save_figure
    from .console import Console
    from .run import flatten_file, save

    new_figure(1, 1)  # says what is missing before the work
    make_folder(output)
    mesh, report, picture = (output / f"sample.{ending}" for ending in ("obj", "json", "png"))
    with Console(verbosity) as console:
        result = flatten_file(sample_path(), console, {"charts": "atlas"})
        result = save(result, console, mesh, report)
        with console.stage("draw", DRAWING):
            save_figure(demo_figure(result), picture)
        console.finish([mesh, report, picture], result)
        console.say(["", "Now try your own:  coneflat flatten MESH -o OUT.obj"])
