"""What a batch has done so far, a line per mesh, and the summary made of it."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...base import printable
from ...errors import MeshFileError, OptionError
from ...io import atomic_write, check_target
from .jobs import COLUMNS, Job

NAME = "batch.jsonl"
HEADINGS = ("mesh", "status", "error", "output", "seconds", *COLUMNS, "notes")
# What every row says.
NEEDED = ("mesh", "output", "status")


class Journal:
    """The file in the results' folder that a further run starts from.

    Attributes:
        rows: the last row of each result.
        broken: the number of lines that are no rows, such as the last one of a run that was cut off.

    Raises:
        MeshFileError: the file cannot be read or written.
    """

    def __init__(self, folder: Path) -> None:
        self._path = check_target(folder / NAME)
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
        """Whether a mesh was flattened, as it is and with these options, and the result is still there."""
        row = self.rows.get(job.output, {})
        return row.get("mark") == job.mark and row.get("status") == "done" and os.path.exists(job.output)

    def add(self, job: Job, row: Mapping[str, Any]) -> None:
        """Write a row down, before anything else is done."""
        row = {**row, "mark": job.mark}
        self.rows[job.output] = row
        try:
            with self._path.open("a", encoding="utf-8") as file:
                file.write("\n" * self._is_cut_off + json.dumps(row) + "\n")
        except OSError as error:
            raise MeshFileError(f"{self._path} cannot be written: {error.strerror or error}") from error
        self._is_cut_off = False


def _row(line: bytes) -> dict[str, Any] | None:
    """Return the row of a line; None for one that is broken."""
    try:
        row = json.loads(line)
    except (ValueError, RecursionError):
        return None
    return row if isinstance(row, dict) and all(isinstance(row.get(name), str) for name in NEEDED) else None


def check_summary(path: Path) -> None:
    """Raise an error if a summary cannot be written.

    Raises:
        OptionError: it cannot have this ending.
        MeshFileError: its folder is missing, or writing is not permitted.
    """
    if path.suffix.lower() != ".csv":
        raise OptionError(f"a summary is a .csv file, not {path.name}")
    check_target(path)


def write_summary(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write a table with a row per mesh as CSV."""
    rows = [
        {name: printable(each) if isinstance(each, str) else each for name, each in row.items()}
        for row in rows
    ]
    with atomic_write(path, "w") as file:
        writer = csv.DictWriter(file, HEADINGS, extrasaction="ignore", restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
