"""What the commands print: progress on stderr, results on stdout."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from types import TracebackType

import click
from rich.console import Console as RichConsole
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from ..result import Flattening
from ..stages import Progress as Listener
from ..stages import Stages
from .talk import QUIET, VERBOSE

PATIENCE = 1.0  # seconds between the plain lines that say what is going on
QUICK = 2.0  # seconds before the first patience begins: what is done soon, or fails, says nothing before
PLAIN_WIDTH = 110
#: What an artist asks first, in this order; the other rows are printed if verbose.
FIRST_ROWS = ("charts", "overlap", "flipped", "texel density", "seam length", "QC distortion", "cones")
EXTREME_QC = 2.0  # far from conformal, on average


class Console:
    """Progress while a command runs, what came out when it is done; nothing if quiet.

    Progress is a bar in a terminal, else a line about every second if it takes long; if verbose, a line for every step.

    Attributes:
        seconds: wall time of each stage.
    """

    def __init__(self, talk: str | None = None) -> None:
        self.quiet, self.verbose = talk == QUIET, talk == VERBOSE
        self._stages = Stages(self.progress)
        self.seconds = self._stages.seconds
        self._start = time.perf_counter()
        self._last_line = QUICK
        self._bar: Progress | None = None
        if talk is None and sys.stderr.isatty():
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

    @property
    def elapsed(self) -> float:
        """Seconds since the start."""
        return time.perf_counter() - self._start

    def progress(self, stage: str, fraction: float) -> None:
        """Show what is being done, and the fraction of the whole that is done."""
        if self._bar:
            self._bar.update(self._task, description=stage, completed=fraction)
        elif not self.quiet and (self.verbose or self.elapsed - self._last_line > PATIENCE):
            self._last_line = self.elapsed
            click.echo(f"{self.elapsed:6.1f} s  {fraction:4.0%}  {stage}", err=True)

    def part(self, begin: float, end: float) -> Listener:
        """Return a listener to a part of the work, which makes up these fractions of the whole."""
        return lambda stage, fraction: self.progress(stage, begin + (end - begin) * fraction)

    @contextmanager
    def stage(self, name: str, done: float) -> Iterator[None]:
        """Show and time a stage, at the beginning of which so much of the whole is done."""
        self._stages.done = done
        with self._stages(name):
            yield

    def say(self, lines: Iterable[str], style: str | None = None) -> None:
        """Print lines of what came out."""
        if self.quiet:
            return
        if self._bar:
            self._bar.stop()
        for line in lines:
            click.secho(line, fg=style)
        self._last_line = self.elapsed
        if self._bar:
            self._bar.start()

    def finish(self, written: Sequence[Path], result: Flattening | None = None) -> None:
        """Print the notes on a result if there is one, what was written, its measures, and where the time went."""
        if self._bar:
            self._bar.stop()
            self._bar = None
        if result is not None:
            self.say(f"note: {note}" for note in result.notes)
        self.say(f"wrote {path}" for path in written)
        if result is not None:
            self.table(self._result_rows(result))
        if self.seconds:
            self.say([f"time           {self._spent(() if result is None else result.solvers)}"])
        if result is not None:
            self.say((f"warning: {each}" for each in _warnings(result)), "yellow")

    def _spent(self, solvers: Sequence[str]) -> str:
        each = ", ".join(f"{stage} {seconds:.2f}" for stage, seconds in self.seconds.items())
        by = f" (solved by {', '.join(solvers)})" if solvers else ""
        return f"{sum(self.seconds.values()):.2f} s: {each}{by}"

    def _result_rows(self, result: Flattening) -> list[tuple[str, str, str]]:
        """Return what an artist wants to know; if verbose, all measures and how the result was found."""
        from ..view.own import shown_rows

        rows = {row[0]: row for row in shown_rows(result)}
        first = [rows.pop(name) for name in FIRST_ROWS if name in rows]
        if not self.verbose:
            return first
        found = asdict(result.solve)
        return [
            *first,
            *rows.values(),
            *((name.replace("_", " "), f"{value:.3g}", "") for name, value in found.items()),
        ]

    def table(self, rows: Iterable[tuple[str, str, str]]) -> None:
        """Print a table of (measure, value, meaning)."""
        if self.quiet:
            return
        if self._bar:
            self._bar.stop()
            self._bar = None
        table = Table(box=None, show_header=False, pad_edge=False)
        table.add_column(style="bold")
        table.add_column()
        table.add_column(style="dim")
        for row in rows:
            table.add_row(*row)
        width = None if sys.stdout.isatty() else PLAIN_WIDTH
        RichConsole(highlight=False, markup=False, width=width).print(table)


def _warnings(result: Flattening) -> Iterator[str]:
    measures, solve = result.distortion, result.solve
    bad = measures.flipped + measures.degenerate
    if bad:
        broken = f"; {solve.broken:,} break the triangle inequality in this metric" if solve.broken else ""
        yield f"{bad:,} of {len(result.faces):,} triangles are flipped or collapsed in the plane{broken}"
    if measures.qc_mean > EXTREME_QC:
        yield f"the mean QC distortion of {measures.qc_mean:.3g} is extreme; more cones would lower it"
