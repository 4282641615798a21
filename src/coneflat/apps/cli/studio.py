"""`coneflat studio`."""

from __future__ import annotations

from pathlib import Path

import click

from ...options.outputs import MOST_TRIANGLES
from .shared import QUIET, VERBOSE, color_option, verbosity_options


@click.command(short_help="Flatten by hand and eye, live in the browser.")
@click.argument("file", type=click.Path(path_type=Path), metavar="[MESH|PROJECT]", required=False)
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=0,
    show_default="a free one",
    help="Port of this machine at which the page is.",
)
@click.option("--no-open", is_flag=True, help="Print the page's address, and open no browser.")
@color_option
@click.option(
    "--most-triangles",
    type=click.IntRange(1),
    default=MOST_TRIANGLES,
    show_default=True,
    help="Thin a larger mesh to so many, for display only.",
)
@verbosity_options
def studio(
    file: Path | None, port: int, no_open: bool, color: str | None, most_triangles: int, verbosity: str | None
) -> None:
    """Move cones and draw seams on a mesh, and see at once what comes of it.

    The page is at an address of this machine that nobody else can use; it is printed first. What is chosen is kept in
    the current folder, in MESH's name with _studio, as .json, from which the studio goes on, and `coneflat flatten
    --project` makes the same layout. A mesh can also be dropped on the page. Ctrl-C ends it.

    \b
    Examples:
      coneflat studio hand.obj
      coneflat studio hand_studio.json
      coneflat studio --port 8000 --no-open
    """
    from ..studio.serve import run_studio

    def say(line: str) -> None:
        # Without a browser nobody would find the page.
        if verbosity != QUIET or no_open:
            click.echo(line)

    tell = click.echo if verbosity == VERBOSE else None
    run_studio(file, port, opens=not no_open, say=say, tell=tell, color=color, most_triangles=most_triangles)
