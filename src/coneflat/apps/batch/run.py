"""Running a batch: a journal records each mesh that is done, and a summary is written at the end."""

from __future__ import annotations

import csv
import json
import os
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...base import Progress, plural, printable
from ...errors import MeshFileError, OptionError
from ...io import atomic_write, check_target, checked_target, make_folder
from ...measures import SUMMARY_MEASURES
from .jobs import Job

#: Function that is called with the row of each completed mesh, the number completed so far, and the total number.
Listener = Callable[[dict[str, Any], int, int], None]


@dataclass(frozen=True)
class BatchSummary:
    """The results of a batch.

    Attributes:
        rows: one per mesh, in the order of the jobs.
        skipped: number of meshes that were done in an earlier run.
        notes: notes on the batch as a whole, one sentence each.
    """

    rows: tuple[dict[str, Any], ...]
    skipped: int
    notes: tuple[str, ...] = ()

    @property
    def failed(self) -> int:
        """Return the number of meshes without a result."""
        return sum(row["status"] != "done" for row in self.rows)


def run_batch(
    jobs: Sequence[Job],
    folder: Path,
    *,
    processes: int | None = None,
    limit: float | None = None,
    dask: str | None = None,
    redo: bool = False,
    summary: Path | None = None,
    listener: Listener | None = None,
    progress: Progress | None = None,
) -> BatchSummary:
    """Flatten many meshes and return a summary; a mesh that fails does not stop the others.

    A journal in the folder records each mesh as soon as it is done. A batch that was interrupted, or that has new
    meshes or options, continues from there. The summary is written in any case.

    Args:
        jobs: the meshes, see `find_jobs`.
        folder: folder of the results.
        processes: number of processes on this machine; None for the number of cores.
        limit: time limit per mesh in seconds; None or infinity for no limit.
        dask: address of a Dask scheduler, to use its cluster instead; its workers must have access to the same files.
        redo: also flatten meshes that are done.
        summary: path of a .csv file; None for summary.csv in the folder.
        listener: called with each result.
        progress: called with a text and the fraction of all work that is done, also while meshes are in work; from
            several threads, one at a time. A cluster reports only meshes that are done, to `listener`.

    Raises:
        OptionError: an argument is not valid.
        MeshFileError: a file cannot be read or written.
    """
    if processes is not None and processes < 1:
        raise OptionError(f"expected at least one process, got {processes}")
    if limit is not None and not limit > 0:
        raise OptionError(f"the time limit must be positive, got {limit:g} s")
    if limit is not None and limit > threading.TIMEOUT_MAX:
        limit = None
    summary = folder / "summary.csv" if summary is None else summary
    make_folder(folder)
    checked_target(summary, (".csv",), "summaries are written as")
    journal = Journal(folder)
    open_jobs = [job for job in jobs if redo or not journal.is_done(job)]
    try:
        for done, (job, row) in enumerate(_rows(open_jobs, processes, limit, dask, progress), start=1):
            journal.add(job, row)
            if listener is not None:
                listener(row, done, len(open_jobs))
    finally:
        rows = tuple(journal.rows[job.output] for job in jobs if job.output in journal.rows)
        write_summary(summary, rows)
    notes: tuple[str, ...] = ()
    if journal.broken:
        notes = (f"Left out {plural(journal.broken, 'broken line')} of the journal.",)
    return BatchSummary(rows, len(jobs) - len(open_jobs), notes)


def _rows(
    jobs: Sequence[Job],
    processes: int | None,
    limit: float | None,
    dask: str | None,
    progress: Progress | None,
) -> Iterator[tuple[Job, dict[str, Any]]]:
    if dask is not None:
        from .process import rows_of_cluster

        return rows_of_cluster(jobs, dask, limit)
    from .process import rows_of_processes, unreported

    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    processes = min(processes or cores, max(len(jobs), 1))
    return rows_of_processes(jobs, processes, limit, progress or unreported)


HEADINGS = ("mesh", "status", "error", "output", "seconds", *SUMMARY_MEASURES, "notes")
# Keys that every row must have.
NEEDED = ("mesh", "output", "status")


class Journal:
    """The file in the folder of the results from which a further run continues.

    Attributes:
        rows: the last row of each result.
        broken: number of lines that are not valid rows, such as the last line of an interrupted run.

    Raises:
        MeshFileError: the file cannot be read or written.
    """

    def __init__(self, folder: Path) -> None:
        self._path = check_target(folder / "batch.jsonl")
        text = b""
        try:
            if self._path.exists():
                text = self._path.read_bytes()
        except OSError as error:
            raise MeshFileError(f"{self._path} cannot be read: {error.strerror or error}") from error
        rows = [_row(line) for line in text.split(b"\n") if line.strip()]
        self.rows: dict[str, dict[str, Any]] = {row["output"]: row for row in rows if row is not None}
        self.broken = rows.count(None)
        self._is_cut_off = bool(text) and not text.endswith(b"\n")

    def is_done(self, job: Job) -> bool:
        """Return whether a mesh was flattened with these options, and its result is still complete."""
        row = self.rows.get(job.output, {})
        expected = (job.mark, "done", _size(job.output))
        return expected[2] is not None and (row.get("mark"), row.get("status"), row.get("size")) == expected

    def add(self, job: Job, row: Mapping[str, Any]) -> None:
        """Append a row to the file immediately."""
        row = {**row, "mark": job.mark, "size": _size(job.output)}
        self.rows[job.output] = row
        try:
            with self._path.open("a", encoding="utf-8") as file:
                file.write("\n" * self._is_cut_off + json.dumps(row) + "\n")
        except OSError as error:
            raise MeshFileError(f"{self._path} cannot be written: {error.strerror or error}") from error
        self._is_cut_off = False


def _size(path: str) -> int | None:
    """Return the size of a file in bytes; None if it does not exist."""
    return os.path.getsize(path) if os.path.exists(path) else None


def _row(line: bytes) -> dict[str, Any] | None:
    """Return the row in a line of the journal; None if it is not valid."""
    try:
        row = json.loads(line)
    except (ValueError, RecursionError):
        return None
    return row if isinstance(row, dict) and all(isinstance(row.get(name), str) for name in NEEDED) else None


def write_summary(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write a CSV table with one row per mesh."""
    rows = [
        {name: printable(cell) if isinstance(cell, str) else cell for name, cell in row.items()}
        for row in rows
    ]
    with atomic_write(path, "w") as file:
        writer = csv.DictWriter(file, HEADINGS, extrasaction="ignore", restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
