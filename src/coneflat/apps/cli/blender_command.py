"""`coneflat blender`."""

from __future__ import annotations

from pathlib import Path

import click


@click.command(short_help="Write the Blender extension.")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
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
