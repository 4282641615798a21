"""`coneflat warm-up`."""

from __future__ import annotations

import click

from .shared import GroupedCommand, verbosity_options


@click.command(
    "warm-up", cls=GroupedCommand, short_help="Compile everything now instead of at the first use."
)
@verbosity_options
def warm_up(verbosity: str | None) -> None:
    """Compile everything now instead of at the first use, and cache it.

    The folder is that of the environment variable CONEFLAT_CACHE_DIR, or else the user's cache folder. A container
    image that runs this command starts fast.
    """
    from ...base import cache_folder, compilation
    from ..warm_up import compile_kernels
    from .run import Console

    folder = cache_folder()
    with Console(verbosity) as console:
        compile_kernels(console.progress)
        if compilation.count:
            kernels = f"compiled {compilation.count} kernels in {console.elapsed:.0f} s"
        else:
            kernels = "all kernels are compiled already"
        console.say([f"{kernels}, cached in {folder}"])
        console.finish([])
