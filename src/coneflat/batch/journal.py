"""What a batch has done so far, a line per mesh, and the summary made of it."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..errors import MeshFileError, OptionError
from ..io import atomic_write
from .child import COLUMNS
from .jobs import Job

NAME = "batch.jsonl"
HEADINGS = ("mesh", "status", "error", "output", "seconds", *COLUMNS, "notes")
SUMMARIES = (".csv", ".parquet")


class Journal:
    """The file in the results' folder that a further run starts from."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / NAME
        self.rows: dict[str, dict[str, Any]] = {}
        if self._path.exists():
            rows = map(_row, self._path.read_text(encoding="utf-8").splitlines())
            self.rows = {row["output"]: row for row in rows if row is not None}

    def is_done(self, job: Job) -> bool:
        """Whether a mesh was flattened, as it is and with these options, and the result is still there."""
        row = self.rows.get(job.output, {})
        return row.get("mark") == job.mark and row.get("status") == "done" and os.path.exists(job.output)

    def add(self, job: Job, row: Mapping[str, Any]) -> None:
        """Write a row down, before anything else is done."""
        row = {**row, "mark": job.mark}
        self.rows[job.output] = row
        try:
            with self._path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
        except OSError as error:
            raise MeshFileError(f"{self._path} cannot be written: {error.strerror}") from error


def _row(line: str) -> dict[str, Any] | None:
    """Return the row of a line; None for the last line of a run that was cut off."""
    try:
        row = json.loads(line)
    except ValueError:
        return None
    return row if isinstance(row, dict) and "output" in row else None


def check_summary(path: Path) -> None:
    """Raise OptionError if a summary cannot have this ending, or what writes it is not installed."""
    if path.suffix.lower() not in SUMMARIES:
        raise OptionError(f"a summary is a {' or '.join(SUMMARIES)} file, not {path.name}")
    if path.suffix.lower() == ".parquet":
        _parquet()


def write_summary(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write a table with a row per mesh, as CSV or Parquet by its ending."""
    if path.suffix.lower() == ".parquet":
        arrow, parquet = _parquet()
        table = arrow.table({name: [row.get(name) for row in rows] for name in HEADINGS})
        with atomic_write(path) as file:
            parquet.write_table(table, file)
        return
    with atomic_write(path, "w") as file:
        writer = csv.DictWriter(file, HEADINGS, extrasaction="ignore", restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def _parquet() -> tuple[Any, Any]:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise OptionError("a Parquet summary needs pyarrow: pip install 'coneflat[parquet]'") from error
    return pyarrow, pyarrow.parquet
