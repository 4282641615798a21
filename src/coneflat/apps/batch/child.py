"""The worker process of a batch, `python -m coneflat.apps.batch.child`: reads jobs, writes rows, one per line."""

from __future__ import annotations

import json
import logging
import os
import sys
import time
from typing import IO, Any

from ...base import Progress, inner_calls


def flatten_file(job: dict[str, Any], progress: Progress | None = None) -> dict[str, Any]:
    """Flatten a mesh file, write the result, and return its row of the summary; errors give a row, too.

    progress: as of `coneflat.flatten`.
    """
    from ... import ConeflatError, flatten, unwrap
    from ...io import read_joined, write_measured
    from ...measures import REPORTED, SUMMARY_MEASURES, breaches, parse_requirements

    start = time.perf_counter()
    row: dict[str, Any] = {"mesh": job["mesh"], "output": job["output"]}
    try:
        source = read_joined(job["mesh"], job["weld"])
        flattening = unwrap if "max_energy" in job["options"] else flatten
        result = flattening(source.mesh, progress=progress, **job["options"])
        result = write_measured(result, job["output"], uv_set=job["uv_set"])
        report = result.report()
        unmet = breaches(parse_requirements(job["required"], REPORTED), report)
        row |= {
            "status": "failed" if unmet else "done",
            "error": f"requirement failed: {'; '.join(unmet)}" if unmet else "",
        } | {name: report[name] for name in SUMMARY_MEASURES}
        row["notes"] = " ".join(source.all_notes(report["notes"]))
    except ConeflatError as error:
        row |= {"status": "failed", "error": str(error)}
    except MemoryError:
        row |= {"status": "failed", "error": "not enough memory for this mesh"}
    except Exception as error:
        row |= {"status": "failed", "error": f"internal error: {type(error).__name__}: {error}"}
    return row | {"seconds": round(time.perf_counter() - start, 3)}


def serve(requests: IO[str], answers: IO[str]) -> None:
    """Read jobs until the end of the input, and write the row of each."""
    for line in requests:
        row = flatten_file(json.loads(line), ProgressLines(answers))
        answers.write(json.dumps(row) + "\n")
        answers.flush()


class ProgressLines:
    """Writes the progress between the rows, at most a few lines per second."""

    #: Seconds between lines.
    INTERVAL = 0.5

    def __init__(self, answers: IO[str]) -> None:
        self._answers = answers
        self._last_line = time.perf_counter()

    def __call__(self, stage: str, fraction: float) -> None:
        """Write the stage and the fraction of the work on the mesh that is done."""
        now = time.perf_counter()
        if now - self._last_line >= self.INTERVAL:
            self._last_line = now
            self._answers.write(json.dumps({"stage": stage, "fraction": fraction}) + "\n")
            self._answers.flush()


class LogLines(logging.Handler):
    """Writes log messages between the rows, so that the batch knows of compilations."""

    def __init__(self, answers: IO[str]) -> None:
        super().__init__()
        self._answers = answers

    def emit(self, record: logging.LogRecord) -> None:
        """Write a message as a line."""
        self._answers.write(json.dumps({"level": record.levelno, "message": record.getMessage()}) + "\n")
        self._answers.flush()


def main() -> None:
    """Serve over standard input and output; what libraries print is redirected to standard error."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    log = logging.getLogger("coneflat")
    log.setLevel(logging.INFO)
    log.propagate = False
    log.addHandler(LogLines(answers))
    with inner_calls():  # The rows have the notes.
        serve(sys.stdin, answers)


if __name__ == "__main__":
    main()
