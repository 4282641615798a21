"""`coneflat warm-up`."""

from __future__ import annotations

import click

from .grouped_help import GroupedCommand
from .shared_flags import verbosity_options


@click.command(
    "warm-up", cls=GroupedCommand, short_help="Compile everything now instead of at the first use."
)
@verbosity_options
def warm_up(verbosity: str | None) -> None:
    """Compile everything now instead of at the first use, and cache it.

    The folder is that of the environment variable CONEFLAT_CACHE_DIR, or else the user's cache folder; without a home
    it is a temporary one. A container image that runs this command starts fast.
    """
    from ...base import cache_folder, compilation, plural
    from ...errors import CacheError
    from ..warm_up import compile_kernels
    from .run import Console

    folder = cache_folder()
    with Console(verbosity) as console:
        compile_kernels(console.progress)
        if compilation.unwritten:
            raise CacheError(f"compiled kernels cannot be written to {folder}: {compilation.unwritten}")
        if compilation.count:
            kernels = f"compiled {plural(compilation.count, 'kernel')} in {console.elapsed:.0f} s"
        else:
            kernels = "all kernels are compiled already"
        console.say([f"{kernels}, cached in {folder}"])
        console.finish([])
