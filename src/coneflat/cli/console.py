"""What the commands print: progress on stderr, the table on stdout."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType

import click
from rich.console import Console as RichConsole
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from ..report import as_rows
from ..result import Flattening

PATIENCE = 1.0  # seconds between the plain lines that say what is going on
PLAIN_WIDTH = 110
EXTREME_QC = 2.0  # far from conformal, on average


class Console:
    """Progress while a command runs, a table when it is done; nothing if quiet."""

    def __init__(self, quiet: bool) -> None:
        self.quiet = quiet
        self._start = time.perf_counter()
        self._last_line = 0.0
        self._bar: Progress | None = None
        if not quiet and sys.stderr.isatty():
            self._bar = Progress(
                SpinnerColumn(),
                TextColumn("{task.description:28}"),
                BarColumn(),
                TimeElapsedColumn(),
                console=RichConsole(stderr=True),
                transient=True,
            )
            self._task = self._bar.add_task("", total=1.0)

    def __enter__(self) -> Console:
        if self._bar:
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar:
            self._bar.stop()

    def progress(self, stage: str, fraction: float) -> None:
        """Show what is being done, and the fraction of the whole that is done."""
        elapsed = time.perf_counter() - self._start
        if self._bar:
            self._bar.update(self._task, description=stage, completed=fraction)
        elif not self.quiet and elapsed - self._last_line > PATIENCE:
            self._last_line = elapsed
            click.echo(f"{elapsed:6.1f} s  {fraction:4.0%}  {stage}", err=True)

    def finish(self, result: Flattening, written: Sequence[Path]) -> None:
        """Print notes, measures, where the time went, and what was written."""
        if self._bar:
            self._bar.stop()
        if self.quiet:
            return
        out = RichConsole(highlight=False, width=None if sys.stdout.isatty() else PLAIN_WIDTH)
        for note in result.notes:
            out.print(f"note: {note}", markup=False)
        table = Table(box=None, show_header=False, pad_edge=False)
        table.add_column(style="bold")
        table.add_column()
        table.add_column(style="dim")
        for row in as_rows(result):
            table.add_row(*row)
        out.print(table)
        total = sum(result.seconds.values())
        spent = ", ".join(f"{stage} {seconds:.2f}" for stage, seconds in result.seconds.items())
        by = f" (solved by {', '.join(result.solvers)})" if result.solvers else ""
        out.print(f"time             {total:.2f} s: {spent}{by}", markup=False, soft_wrap=True)
        for path in written:
            out.print(f"wrote {path}", markup=False)
        self._warn(out, result)

    def _warn(self, out: RichConsole, result: Flattening) -> None:
        measures, solve = result.distortion, result.solve
        bad = measures.flipped + measures.degenerate
        if bad:
            broken = (
                f"; {solve.broken:,} break the triangle inequality in this metric" if solve.broken else ""
            )
            out.print(
                f"warning: {bad:,} of {len(result.faces):,} triangles are flipped or collapsed in the plane{broken}",
                style="yellow",
                soft_wrap=True,
            )
        if measures.qc_mean > EXTREME_QC:
            out.print(
                f"warning: the mean QC distortion of {measures.qc_mean:.3g} is extreme; more cones would lower it",
                style="yellow",
                soft_wrap=True,
            )
