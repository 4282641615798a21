"""Reading, flattening and writing for commands, with progress on stderr and a summary on stdout."""

from __future__ import annotations

import json
import logging
import os
import shutil
import sys
import textwrap
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout, suppress
from dataclasses import asdict, replace
from io import BytesIO
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import click

from ... import Flattening, flatten, read_flattening
from ...base import Progress as Listener
from ...base import Stopwatch, printable
from ...errors import OptionError
from ...io import PIPE, Joined, as_written, atomic_write, has_uv, read_joined, write_measured, write_stream
from .flags import repair_keywords
from .shared_flags import QUIET, VERBOSE

if TYPE_CHECKING:
    from rich.progress import Progress

LOG = logging.getLogger("coneflat")
# Seconds, and fraction of all work, after which the rest of the time is estimated.
MIN_ELAPSED, MIN_FRACTION = 3.0, 0.05
# Columns of tables that are not printed in a terminal, and least number of columns for the meanings of measures.
WIDTH, MIN_MEANING = 110, 30
AGAIN = "--again flattens the mesh again"


class Console:
    """Output of a command: progress while it runs and a summary when it is done; nothing if quiet.

    Progress is a bar in a terminal, otherwise about one line per second, also within long steps, and none within the
    first second. If verbose, it is one line per step.

    Attributes:
        seconds: wall time of each stage.
    """

    #: Approximate fractions of all work that are completed when the mesh has been read, and when it is flattened.
    READ, FLATTENED = 0.03, 0.92
    #: Seconds between lines of progress, and before the first one.
    INTERVAL = 1.0

    def __init__(self, verbosity: str | None = None) -> None:
        self.quiet, self.verbose = verbosity == QUIET, verbosity == VERBOSE
        self._stages = Stopwatch(self.progress)
        self.seconds = self._stages.seconds
        self._start = time.perf_counter()
        self._last_line = 0.0
        self._current = ("", 0.0)
        self._lock = threading.Lock()
        self._is_finished = threading.Event()
        self._bar: Progress | None = None
        if verbosity is None and sys.stderr.isatty():
            self._bar = _bar()
            self._task = self._bar.add_task("", total=1.0, left="")

    def __enter__(self) -> Console:
        self._level = LOG.level
        if self.quiet:
            LOG.setLevel(logging.ERROR)
        if self._bar:
            self._bar.start()
        elif not self.quiet and not self.verbose:
            threading.Thread(target=self._repeat_progress, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        LOG.setLevel(self._level)
        with self._lock:
            self._is_finished.set()
        if self._bar:
            self._bar.stop()

    @property
    def elapsed(self) -> float:
        """Return the seconds since the start."""
        return time.perf_counter() - self._start

    def progress(self, stage: str, fraction: float) -> None:
        """Show the current stage and the completed fraction of all work."""
        if self._bar:
            left = time_left(self.elapsed, fraction)
            self._bar.update(self._task, description=stage, completed=fraction, left=left)
            return
        with self._lock:
            self._current = (stage, fraction)
            if not self.quiet and (self.verbose or self.elapsed - self._last_line > self.INTERVAL):
                self._print_progress()

    def _print_progress(self) -> None:
        stage, fraction = self._current
        self._last_line = self.elapsed
        with suppress(OSError):  # A full stderr does not stop the work, nor a reader that has closed it.
            left = time_left(self.elapsed, fraction)
            ending = f" ({left})" if left else ""
            click.echo(f"{self.elapsed:6.1f} s  {fraction:4.0%}  {stage}{ending}", err=True)

    def _repeat_progress(self) -> None:
        """Print the progress again if nothing has been printed for a while."""
        while not self._is_finished.wait(self.INTERVAL / 4):
            with self._lock, suppress(ValueError):  # The stream may be closed.
                late = self.elapsed - self._last_line > self.INTERVAL * (1 + bool(self._last_line))
                if late and self._current[0] and not self._is_finished.is_set():
                    self._print_progress()

    def part(self, begin: float = READ, end: float = FLATTENED) -> Listener:
        """Return a listener for a part of the work, from fraction `begin` to fraction `end` of all work."""
        return lambda stage, fraction: self.progress(stage, begin + (end - begin) * fraction)

    @contextmanager
    def stage(self, name: str, done: float = FLATTENED) -> Iterator[None]:
        """Show and time a stage; `done` is the completed fraction of all work at its beginning."""
        self._stages.done = done
        with self._stages(name):
            yield

    def say(self, lines: Iterable[str]) -> None:
        """Print lines to stdout, unless quiet."""
        if self.quiet:
            return
        if self._bar:
            self._bar.stop()
        for line in lines:
            click.echo(line)
        self._last_line = self.elapsed
        if self._bar:
            self._bar.start()

    def finish(self, written: Sequence[Path], result: Flattening | None = None) -> None:
        """Print the notes on a result, if given, the files written, its measures, and the time of each stage."""
        with self._lock:
            self._is_finished.set()
        if self._bar:
            self._bar.stop()
            self._bar = None
        if result is not None:
            self.notes(result.notes)
        self.say(f"wrote {printable(path)}" for path in written)
        if result is not None:
            self.table(self._result_rows(result))
        if self.seconds:
            self.say([f"time           {self._time_text()}"])

    def _time_text(self) -> str:
        elapsed = self.elapsed
        # Loading modules and printing are not stages.
        seconds = {**self.seconds, "other": max(elapsed - sum(self.seconds.values()), 0.0)}
        stages = ", ".join(f"{stage} {taken:.2f}" for stage, taken in seconds.items())
        return f"{elapsed:.2f} s: {stages}"

    def _result_rows(self, result: Flattening) -> list[tuple[str, str, str]]:
        """Return the main measures; if verbose, all measures and the statistics of the solvers."""
        from ...measures import FIRST_ROWS
        from ..view import shown_rows

        rows = {row[0]: row for row in shown_rows(result)}
        first = [rows.pop(name) for name in FIRST_ROWS if name in rows]
        if not self.verbose:
            return first
        statistics = asdict(result.solve)
        return [
            *first,
            *rows.values(),
            *((name.replace("_", " "), f"{value:.3g}", "") for name, value in statistics.items()),
        ]

    def notes(self, notes: Iterable[str]) -> None:
        """Print notes, in a terminal wrapped at words; elsewhere each is one line, for programs that search for it."""
        width = _terminal_width()
        for note in notes:
            text = f"note: {note}"
            self.say(
                [text] if width is None else textwrap.wrap(text, width, subsequent_indent="  ") or [text]
            )

    def table(self, rows: Iterable[tuple[str, str, str]]) -> None:
        """Print a table of (measure, value, meaning)."""
        self.say(_lines_of_table(list(rows)))


def time_left(elapsed: float, fraction: float) -> str:
    """Return about how long the rest of the work takes; "" while too little is done to tell.

    Args:
        elapsed: seconds since the start.
        fraction: the fraction of all work that is done.
    """
    if elapsed < MIN_ELAPSED or not MIN_FRACTION <= fraction < 1:
        return ""
    seconds = elapsed * (1 / fraction - 1)
    for unit, size in (("h", 3600), ("min", 60)):
        if seconds >= 0.95 * size:
            return f"about {max(round(seconds / size), 1)} {unit} left"
    return f"about {max(5 * round(seconds / 5), 5)} s left"


def _bar() -> Progress:
    from rich.console import Console as RichConsole
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    left = TextColumn("{task.fields[left]}")
    columns = SpinnerColumn(), TextColumn("{task.description:28}"), BarColumn(), TimeElapsedColumn(), left
    # Lines are printed while no bar is shown. A library that takes stdout for itself would otherwise keep a replacement
    # of it, which no longer exists when the process ends.
    return Progress(*columns, console=RichConsole(stderr=True), transient=True, redirect_stdout=False)


def _lines_of_table(rows: Sequence[tuple[str, str, str]]) -> Iterator[str]:
    """Yield the lines of a table as wide as the terminal, or 110; its last column is wrapped.

    In a narrow terminal, each row is a block: the last column is below the others. click removes the styles if stdout
    is not a terminal.
    """
    width = _terminal_width() or WIDTH
    names, values = (max((len(row[column]) for row in rows), default=0) for column in (0, 1))
    available = width - names - values - 4
    if available < MIN_MEANING:
        yield from _lines_of_blocks(rows, width)
        return
    for name, value, meaning in rows:
        first, *continued = textwrap.wrap(meaning, available) or [""]
        cells = click.style(f"{name:{names}}", bold=True), f"{value:{values}}", click.style(first, dim=True)
        yield "  ".join(cells if first else cells[:2]).rstrip()
        yield from (" " * (names + values + 4) + click.style(line, dim=True) for line in continued)


def _lines_of_blocks(rows: Sequence[tuple[str, str, str]], width: int) -> Iterator[str]:
    """Yield the lines of a table as blocks: names and values, and the meanings below, indented."""
    for name, value, meaning in rows:
        yield f"{click.style(name, bold=True)}  {value}".rstrip()
        for line in textwrap.wrap(meaning, max(width - 4, 20)):
            yield "    " + click.style(line, dim=True)


def _terminal_width() -> int | None:
    """Return the number of columns of the terminal; None if stdout is none."""
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else None


@contextmanager
def redirect_prints(output: Path) -> Iterator[IO[bytes] | None]:
    """Yield stdout if the result is written there, and redirect everything else that is printed to stderr."""
    if output != PIPE:
        yield None
        return
    stdout = sys.stdout.buffer
    with redirect_stdout(sys.stderr):
        yield stdout


def open_result(
    file: Path,
    console: Console,
    *,
    again: bool = False,
    repair: bool = True,
    weld: bool | None = None,
    by: Callable[..., Flattening] = flatten,
) -> Flattening:
    """Return the result in a .npz file, the UVs of a mesh file as a result, or else the mesh flattened by a function.

    again: also flatten a mesh that has UVs.
    """
    with console.stage("read", 0.0):
        if file.suffix.lower() == ".npz":
            return read_flattening(file)
        source = read_joined(file, weld)
    if not again and has_uv(source.mesh):
        from ..view import own_flattening

        with console.stage("measure", console.READ):
            shown = own_flattening(source, strict=not repair)
        if shown is not None:
            return replace(shown, notes=(f"The UVs of {file.name} are shown; {AGAIN}.", *shown.notes))
    return flatten_joined(source, console, {"charts": "atlas", **repair_keywords(repair)}, by)


def archive_path(file: Path) -> Path | None:
    """Return the path if it is that of an archive (.npz), which may contain further arrays; else None."""
    return file if file.suffix.lower() == ".npz" else None


def flatten_file(
    mesh: Path,
    console: Console,
    options: Mapping[str, Any],
    weld: bool | None = None,
    by: Callable[..., Flattening] = flatten,
) -> Flattening:
    """Read and flatten a mesh file by a function, show the progress, and return the result."""
    with console.stage("read", 0.0):
        source = read_joined(mesh, weld)
    return flatten_joined(source, console, options, by)


def flatten_joined(
    source: Joined, console: Console, options: Mapping[str, Any], by: Callable[..., Flattening] = flatten
) -> Flattening:
    """Flatten a mesh that has been read, show the progress, and return the result."""
    result = by(source.mesh, progress=console.part(), **source.map_options(options))
    console.seconds.update(result.seconds)
    return replace(result, notes=source.all_notes(result.notes))


def save(
    result: Flattening,
    console: Console,
    output: Path,
    report: Path | None,
    texture: str | None = None,
    stdout: IO[bytes] | None = None,
    ending: str = ".obj",
    uv_set: int | None = None,
) -> Flattening:
    """Write a result and its report, and return it as it was written, with the times of all stages.

    Args:
        result: the result.
        console: where the stage is shown.
        output, report: the files; no report if None.
        texture, uv_set: as of `write_flattening`.
        stdout: stream to write to instead of `output`, in the format given by `ending`.
        ending: the ending of that format.
    """
    with console.stage("write"):
        if stdout is None:
            result = write_measured(result, output, texture, uv_set)
        else:
            # Like files, the result is written completely or not at all.
            content = BytesIO()
            stored = write_stream(result, content, ending, texture, uv_set=uv_set)
            result = as_written(stored, ending, has_texture=texture is not None, uv_set=uv_set)
            stdout.write(content.getbuffer())
            stdout.flush()
    result = replace(result, seconds=dict(console.seconds))
    if report is not None:
        write_report(report, result.report())
    return result


def write_report(path: Path, report: Mapping[str, Any]) -> None:
    """Write a report as JSON."""
    with atomic_write(path, "w") as file:
        json.dump(report, file, indent=2)
        file.write("\n")


def require_distinct(files: Mapping[str, Path | None]) -> None:
    """Raise OptionError if two paths are the same file, so that one would overwrite the other."""
    seen: dict[str, str] = {}
    for role, path in files.items():
        if path is None or path == PIPE:
            continue
        where = os.path.normcase(os.path.realpath(path))
        if where in seen:
            raise OptionError(
                f"{path} is both the {seen[where]} and the {role}: choose another name for one of them"
            )
        seen[where] = role
