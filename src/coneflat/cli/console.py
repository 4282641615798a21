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

PATIENCE = 1.0  # seconds before a plain line says what is going on
PLAIN_WIDTH = 110


class Console:
    """Progress while a command runs, a table when it is done; nothing if quiet."""

    def __init__(self, quiet: bool) -> None:
        self.quiet = quiet
        self._start = time.perf_counter()
        self._bar: Progress | None = None
        if not quiet and sys.stderr.isatty():
            self._bar = Progress(
                SpinnerColumn(),
                TextColumn("{task.description:8}"),
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
        """Show the stage that begins, and the fraction of triangles that are done."""
        elapsed = time.perf_counter() - self._start
        if self._bar:
            self._bar.update(self._task, description=stage, completed=fraction)
        elif not self.quiet and elapsed > PATIENCE:
            done = f"  ({fraction:.0%} of triangles done)" if 0 < fraction < 1 else ""
            click.echo(f"{elapsed:6.1f} s  {stage}{done}", err=True)

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
        out.print(f"time             {total:.2f} s: {spent}", markup=False, soft_wrap=True)
        for path in written:
            out.print(f"wrote {path}", markup=False)
        self._warn(out, result)

    def _warn(self, out: RichConsole, result: Flattening) -> None:
        bad = result.distortion.flipped + result.distortion.degenerate
        if bad:
            out.print(
                f"warning: {bad} of {len(result.faces):,} triangles are flipped or collapsed in the plane; "
                f"{result.solve.broken} break the triangle inequality in this metric",
                style="yellow",
            )
