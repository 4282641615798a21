"""A process that flattens: `python -m coneflat.apps.studio.child` reads jobs and writes layouts.

A flattening is given up as soon as a newer one is wanted. The mesh stays in memory between them, with all that depends
on it alone.
"""

from __future__ import annotations

import os
import sys
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import IO

import numpy as np

from ... import ConeflatError, Flattener, Flattening
from ...base import asking
from ...errors import NonManifoldError, NonOrientableError
from ...io import Joined, read_joined
from ...options import MOST_TRIANGLES
from ..view import Model, Quantity, Told, content_of, head_and_block, own_quantity, pack, shown_rows
from .choices import Choices
from .known import with_prints
from .messages import in_page, noted, strained
from .outputs import curve_of, quads_of, saved
from .worker import Head, read_frame, write_frame

#: Polygons from which on the first layout is shown, too: of smaller meshes the last is there as soon.
EARLY_POLYGONS = 20_000
#: What stands for numbers until they are known, and what the first layout is.
TO_COME = "…"
FIRST = "First view: distortion is yet to be evened out, and overlaps to be parted  ·  …"


class Superseded(Exception):
    """A newer flattening is wanted."""


class Jobs:
    """What is to be done, in order; of flattenings only the newest."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        self._waiting: deque[Head] = deque()
        self._changed = threading.Condition()
        self._newest = -1
        self._over = False
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        while (frame := read_frame(self._stream)) is not None:
            job = frame[0]
            with self._changed:
                if job["do"] == "flatten":
                    self._newest = job["job"]
                    self._waiting = deque(each for each in self._waiting if each["do"] != "flatten")
                self._waiting.append(job)
                self._changed.notify()
        with self._changed:
            self._over = True
            self._changed.notify()

    def next(self) -> Head | None:
        """Return the next job; None when there will be no more."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._over)
            return None if self._over else self._waiting.popleft()

    def is_stale(self, job: int) -> bool:
        """Whether a flattening is no longer wanted."""
        return self._over or job != self._newest


class Bench:
    """Flattens again and again; what depends on the mesh alone stays from one flattening to the next.

    Attributes:
        result: of the last flattening; None where it has failed.
    """

    def __init__(self, early_from: int = EARLY_POLYGONS) -> None:
        """early_from: polygons of meshes whose first layout is shown, too."""
        self.result: Flattening | None = None
        self._early_from = early_from
        self._source: Joined | None = None
        self._flattener: Flattener | None = None
        self._model: Model | None = None
        self._most: int | None = None
        self._read: tuple[str, str] | None = None

    def flatten(
        self, job: Head, told: Callable[[str, float], None], show: Callable[[Head, bytes], None]
    ) -> tuple[Head, bytes]:
        """Return a layout as the page takes it: numbers and texts, and arrays.

        Args:
            job: the mesh, and what is chosen.
            told: called with what is being done, and the fraction that is done.
            show: called with the first layout, in the same form, before it is what it is to be.
        """

        self.result, self._most = None, job.get("most")
        source, flattener = self._open(job["mesh"], job["sha256"], told)
        name, furthest = Path(job["mesh"]).name, 0.0

        def told_on(stage: str, fraction: float) -> None:
            nonlocal furthest
            furthest = max(furthest, fraction)
            told(stage, furthest)

        def show_first(first: Flattening) -> None:
            told_on("first view", furthest)
            show(*self._picture(first, name, is_first=True))

        chosen = Choices.from_plain(job["choices"])
        words, is_large = source.renamed(chosen.keywords()), len(source.mesh.offsets) - 1 >= self._early_from
        result = flattener.flatten(on_preview=show_first if is_large else None, progress=told_on, **words)
        result = noted(replace(result, notes=source.notes_of(result.notes)), chosen)
        told("picture", 1.0)
        head, body = self._coloured(job, result, name)
        self.result = result
        return {**head, "warnings": strained(chosen, result)}, body

    def _coloured(self, job: Head, result: Flattening, name: str) -> tuple[Head, bytes]:
        """Return what the page shows of a result, with colours of the user's own; without, if there are none such."""

        if not job.get("color"):
            return self._picture(result, name)
        try:
            own = own_quantity(result, job["color"])
        except ConeflatError as error:
            head, body = self._picture(result, name)
            return {**head, "missing": in_page(str(error))}, body
        return self._picture(result, name, own=own)

    def make(self, job: Head, told: Callable[[str, float], None]) -> tuple[Head, bytes]:
        """Return what is asked for beside layouts: a file of the result, quads, or a curve."""

        if job["do"] == "export":
            return {}, saved(self.result, job["ending"])
        source, _ = self._open(job["mesh"], job["sha256"], told)
        chosen = Choices.from_plain(job["choices"])
        if job["do"] == "quads":
            return {}, quads_of(source, chosen, job["count"], job["ending"], told)
        return curve_of(source, chosen, told), b""

    def _picture(
        self, result: Flattening, name: str, is_first: bool = False, own: Quantity | None = None
    ) -> tuple[Head, bytes]:
        """Return what the page shows of a result; of the first layout no numbers, which will be others.

        own: numbers that are shown as colours.
        """

        told = None
        if is_first:
            rows = [(measure, TO_COME, meaning) for measure, _, meaning in shown_rows(result)]
            told = Told(FIRST, rows)
            result = replace(result, notes=())
        if self._model is None or not self._model.is_of(result):
            self._model = Model.of(result)
        content = content_of(result, self._most or MOST_TRIANGLES, self._model, own)
        show = "checker" if own is None else "own"
        head, block = head_and_block(result, content, None, name, "y", show, told)
        # All of a mesh of up to so many triangles, to paint and draw on, where the page shows fewer.
        if content.left_out and len(result.faces) <= 4_000_000:
            head, block = with_whole(head, block, self._model, result)
        head["notes"] = [in_page(note) for note in head["notes"]]
        cones = result.cones if result.vertex_origin is None else result.vertex_origin[result.cones]
        told_of = {"head": with_prints(head, block), "found": cones.tolist(), "seconds": result.seconds}
        return told_of, block

    def _open(self, mesh: str, sha256: str, told: Callable[[str, float], None]) -> tuple[Joined, Flattener]:

        if self._source is None or self._flattener is None or self._read != (mesh, sha256):
            told("read", 0.0)
            self._source = self._flattener = self._model = None  # There may not be memory for both.
            source = read_joined(Path(mesh))
            self._source, self._flattener, self._read = source, Flattener(source.mesh), (mesh, sha256)
        return self._source, self._flattener


def with_whole(head: Head, block: bytes, model: Model, result: Flattening) -> tuple[Head, bytes]:
    """Return what the page shows of a result, and all vertices and triangles of its mesh beside."""

    arrays = {
        "whole_places": model.places.astype(np.float32),
        "whole_faces": np.searchsorted(model.used, model.mesh.faces).astype(np.uint32),
    }
    numbers = model.used if result.vertex_origin is None else result.vertex_origin[model.used]
    if not np.array_equal(numbers, np.arange(len(numbers))):
        arrays["whole_numbers"] = numbers.astype(np.int32)
    listed, more = pack(arrays)
    moved = [{**each, "offset": each["offset"] + len(block)} for each in listed]
    return {**head, "arrays": [*head["arrays"], *moved]}, block + more


def serve(jobs: Jobs, answers: IO[bytes]) -> None:
    """Do jobs until there are no more."""
    bench = Bench()
    while (job := jobs.next()) is not None:
        number = job["job"]

        def ask(wanted: int = job.get("after") or number) -> None:
            if jobs.is_stale(wanted):
                raise Superseded

        def told(stage: str, fraction: float, number: int = number) -> None:
            ask()
            write_frame(answers, {"job": number, "stage": stage, "fraction": fraction})

        def show(head: Head, body: bytes, number: int = number) -> None:
            ask()
            write_frame(answers, {"job": number, "early": head}, body)

        try:
            with asking(ask):
                head, body = (
                    bench.flatten(job, told, show) if job["do"] == "flatten" else bench.make(job, told)
                )
            write_frame(answers, {"job": number, "done": head}, body)
        except Superseded:
            write_frame(answers, {"job": number, "given_up": True})
        except ConeflatError as error:
            # What a repair would mend, a button of the page does.
            mends = isinstance(error, (NonManifoldError, NonOrientableError))
            write_frame(answers, {"job": number, "error": in_page(str(error)), "repair": mends})
        except MemoryError:
            write_frame(answers, {"job": number, "error": "not enough memory for this mesh", "repair": False})
        except Exception as error:
            said = f"internal error, please report it: {type(error).__name__}: {error}"
            write_frame(answers, {"job": number, "error": said, "repair": False})


def main() -> None:
    """Serve over standard input and output, which libraries that print of themselves do not get at."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    serve(Jobs(sys.stdin.buffer), answers)


if __name__ == "__main__":
    main()
