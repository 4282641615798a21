"""Running a batch."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...base import plural
from ...errors import OptionError
from ...io import make_folder
from .jobs import Job
from .journal import Journal, check_summary, write_summary

#: Called with the row of each mesh that has been worked on, how many there are so far, and how many there will be.
Listener = Callable[[dict[str, Any], int, int], None]


@dataclass(frozen=True)
class BatchSummary:
    """What came of a batch.

    Attributes:
        rows: one per mesh, in the order of the jobs.
        skipped: meshes that were done before.
        notes: what is to be said of the batch as a whole, one sentence each.
    """

    rows: tuple[dict[str, Any], ...]
    skipped: int
    notes: tuple[str, ...] = ()

    @property
    def failed(self) -> int:
        """The number of meshes without a result."""
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
) -> BatchSummary:
    """Flatten many meshes; those that fail do not stop the rest.

    A journal in the folder remembers each mesh as soon as it is done, so a batch that was cut off, or that has new
    meshes or options, goes on from there. The summary is written in any case.

    Args:
        jobs: see `find_jobs`.
        folder: of the results.
        processes: on this machine; None: as many as there are cores.
        limit: seconds per mesh, after which it has failed; None, or infinity, for none.
        dask: address of a Dask scheduler, to work on its cluster instead; its workers must see the same files.
        redo: work on meshes that are done, too.
        summary: a .csv file; None: summary.csv in the folder.
        listener: called as results come in.

    Raises:
        OptionError: an argument makes no sense.
        MeshFileError: something cannot be written.
    """
    if processes is not None and processes < 1:
        raise OptionError(f"there must be at least one process, not {processes}")
    if limit is not None and not limit > 0:
        raise OptionError(f"the time limit must be positive, not {limit:g} s")
    if limit is not None and limit > threading.TIMEOUT_MAX:
        limit = None
    summary = folder / "summary.csv" if summary is None else summary
    make_folder(folder)
    check_summary(summary)
    journal = Journal(folder)
    open_jobs = [job for job in jobs if redo or not journal.is_done(job)]
    try:
        for done, (job, row) in enumerate(_rows(open_jobs, processes, limit, dask), start=1):
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
    jobs: Sequence[Job], processes: int | None, limit: float | None, dask: str | None
) -> Iterator[tuple[Job, dict[str, Any]]]:
    if dask is not None:
        from .process import rows_of_cluster

        return rows_of_cluster(jobs, dask, limit)
    from .process import rows_of_processes

    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return rows_of_processes(jobs, min(processes or cores, max(len(jobs), 1)), limit)
