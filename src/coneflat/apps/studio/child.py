"""The worker process of the studio, `python -m coneflat.apps.studio.child`: reads jobs and writes layouts.

A flattening is cancelled as soon as a newer one is requested. The mesh, and everything that depends on it alone, is
cached between flattenings.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ... import ConeflatError, Flattener, Flattening
from ...base import FloatArray, cancel_with, inner_calls
from ...errors import DegenerateFaceError, NonManifoldError, NonOrientableError
from ...io import Joined, Texture, read_joined
from ...options import MAX_SHOWN_TRIANGLES
from ...quadmesh import QuadMesh
from ...source import LatestCache
from ...textures import Unwrapper
from ..transfer import own_picture
from ..view import (
    Model,
    PageText,
    Quantity,
    content_of,
    head_and_block,
    own_quantity,
    pack,
    page_of_quads,
    shown_rows,
    text_of,
    upward_axis,
)
from .choices import DECLARED, Choices
from .jobs import Jobs, Superseded
from .layouts import LatestLayouts, MadeLayout
from .messages import misplaced_warning, notes_on_controls, page_message, with_warnings
from .outputs import (
    SavedFile,
    as_shown,
    bad_places,
    curve_data,
    quad_notes,
    quads_file,
    quads_of,
    repaired,
    result_file,
    without_layout,
)
from .pins import NO_PINS, Pins, places_of_charts
from .places import shape_message, shape_of
from .worker import Head, with_hashes, write_frame

#: The text that stands for unknown numbers, and the titles of pages without a final layout.
PLACEHOLDER = "…"
BARE_TITLE = "No layout"
COMPUTING_TITLE = "Computing the first layout"
FIRST_TITLE = "Preview: distortion is not yet reduced, and overlaps are not yet removed  ·  …"


class Opened(NamedTuple):
    """A mesh that was read, and what maps it repeatedly."""

    source: Joined
    flattener: Flattener
    unwrapper: Unwrapper


class JobRunner:
    """Runs jobs, and caches what depends on the mesh alone.

    Attributes:
        result: result of the last flattening; None if it has failed.
        quads: the quads that were computed last; None if there are none.
    """

    def __init__(self, early_from: int = 20_000) -> None:
        """early_from: number of polygons from which on a preview is shown; for fewer the final layout is as fast."""
        self.result: Flattening | None = None
        self.quads: QuadMesh | None = None
        self._early_from = early_from
        self._opened: Opened | None = None
        self._layouts = LatestLayouts()
        # The map for a texture without pins, whose key is the choices.
        self._unpinned: LatestCache[Flattening] = LatestCache()
        self._base: Flattening | None = None  # The one that was used last.
        self._model: Model | None = None
        self._up = "y"
        self._max_triangles: int | None = None
        self._own_texture: tuple[Texture, FloatArray] | None = None
        # Path and hash of the mesh that was read, and of the one whose shape the session has got.
        self._read: tuple[str, str] | None = None
        self._told: tuple[str, str] | None = None

    def flatten(
        self,
        job: Head,
        report: Callable[[str, float], None],
        show: Callable[[Head, bytes], None],
        tell: Callable[[str, Mapping[str, Any], bytes], None] = lambda kind, head, body: None,
    ) -> tuple[Head, bytes]:
        """Return a layout as data for the page: numbers and texts, and the bytes of arrays.

        Args:
            job: the mesh and the choices.
            report: called with the stage and the completed fraction.
            show: called with a preview of the layout, in the same form.
            tell: called with the kind of a message and its content after the mesh was read: "model" for its page data
                without a layout, if the job is the `first` one, and "shape", as of `shape_message`.
        """

        self.result, self._max_triangles = None, job.get("most")
        source, *_ = self._open(job["mesh"], job["sha256"], report)
        if job.get("first"):
            report("check", 0.0)
            model, body = self.bare(job, COMPUTING_TITLE)
            if model:
                tell("model", model, body)
        if self._told != self._read:
            tell("shape", *shape_message(shape_of(source.mesh), job["sha256"]))
            self._told = self._read
        made = self._layouts.get(job)
        if made is None:
            made = self._made(job, report, show)
            self._layouts.put(job, made)
        self.result = made.result
        return made.head, made.body

    def _made(
        self, job: Head, report: Callable[[str, float], None], show: Callable[[Head, bytes], None]
    ) -> MadeLayout:
        """Return the layout of a job, which is computed; arguments as of `flatten`."""
        source, *_ = self._open(job["mesh"], job["sha256"], report)
        chosen = Choices.from_plain(job["choices"])
        result = with_warnings(self._mapped(job, chosen, report, show), chosen)
        report("picture", 1.0)
        quantity, missing = None, {}
        if job.get("color"):
            try:
                quantity = own_quantity(result, job["color"])
            except ConeflatError as error:
                missing = {"missing": page_message(str(error))}
        shown = as_shown(result)
        head, body = self._picture(result, Path(job["mesh"]).name, text_of(shown), quantity, chosen.used_pins)
        notes = head["head"]["notes"] = [page_message(note) for note in shown.notes]
        # The session warns of choices itself, as soon as they are made.
        warned = {page_message(note) for note in misplaced_warning(chosen)}
        warnings = tuple(note for note in notes if note not in warned)
        if chosen.options.get("repair"):
            checked, wrong = repaired(source)
            head["head"]["bad"] = bad_places(checked)
            repair = (f"The mesh was repaired: {wrong}. “Undo” reverts this.",) if wrong else ()
            warnings = (*repair, *warnings)
        texts = {"warnings": warnings, "on_controls": notes_on_controls(notes)}
        return MadeLayout(result, {**head, **missing, **texts}, body)

    def _mapped(
        self,
        job: Head,
        chosen: Choices,
        report: Callable[[str, float], None],
        show: Callable[[Head, bytes], None],
    ) -> Flattening:
        """Return the map of a job with the notes on its mesh; arguments as of `flatten`."""
        source, flattener, unwrapper = self._open(job["mesh"], job["sha256"], report)
        furthest = 0.0

        def report_max(stage: str, fraction: float) -> None:
            nonlocal furthest
            furthest = max(furthest, fraction)
            report(stage, furthest)

        def show_first(first: Flattening) -> None:
            report_max("preview", furthest)
            show(*self._picture(first, Path(job["mesh"]).name, _text_of_preview(first)))

        words = source.map_options(chosen.keywords())
        if chosen.for_texture:
            key = replace(chosen, pins=Pins(), units=("", ""))
            unpinned = self._unpinned.of(key, lambda: unwrapper.unwrap(progress=report_max, **words))
            self._base = unpinned
            result = chosen.pins.applied(unpinned)
        else:
            on_preview = show_first if len(source.mesh.offsets) - 1 >= self._early_from else None
            result = flattener.flatten(on_preview=on_preview, progress=report_max, **words)
        return replace(result, notes=source.all_notes(result.notes))

    def bare(self, job: Head, title: str = BARE_TITLE) -> tuple[Head, bytes]:
        """Return the page data of the mesh of a job without a layout; nothing if no triangle can be drawn."""
        with suppress(ConeflatError):
            if self._opened is not None:
                checked, _ = repaired(self._opened.source)
                data, block = self._picture(
                    without_layout(checked), Path(job["mesh"]).name, PageText(title, [])
                )
                data["head"] |= {"bad": bad_places(checked), "show": "plain"}
                return data, block
        return {}, b""

    def make(self, job: Head, report: Callable[[str, float], None]) -> tuple[Head, bytes]:
        """Return the output of another job: a file of the result, the page of quads or their file, or a curve."""

        if job["do"] == "export":
            return _answer(result_file(self.result, job["ending"]))
        if job["do"] == "quads file":
            return _answer(quads_file(self.quads, job["ending"]))
        source, *_ = self._open(job["mesh"], job["sha256"], report)
        chosen = Choices.from_plain(job["choices"])
        if job["do"] == "quads":
            self.quads = None
            self.quads = quads_of(source, chosen, job["count"], report)
            page = page_of_quads(self.quads, name=Path(job["mesh"]).name, show="checker")
            return _answer(SavedFile(page.encode("utf-8"), quad_notes(self.quads)))
        return curve_data(source, chosen, report), b""

    def _picture(
        self,
        result: Flattening,
        name: str,
        text: PageText,
        quantity: Quantity | None = None,
        pins: Pins = NO_PINS,
    ) -> tuple[Head, bytes]:
        """Return the page data of a result, without notes.

        Args:
            result: the result.
            name: name of the mesh.
            text: title and rows of the page.
            quantity: quantity that is shown as colours.
            pins: the charts that are pinned, in the map for a texture that was computed last.
        """

        if self._model is None or not self._model.is_of(result):
            self._model = Model.of(result)
            self._up = upward_axis(result.vertices, result.faces, Path(name).suffix)
        content = content_of(result, self._max_triangles or MAX_SHOWN_TRIANGLES, self._model, quantity)
        show = "checker" if quantity is None else "own"
        picture, uv = self._own_texture or (None, None)
        head, block = head_and_block(result, content, picture, name, self._up, show, text)
        if uv is not None and result.face_corners is not None:
            own_uv = uv[result.face_corners[content.face_numbers]].astype(np.float32)
            head, block = with_arrays(head, block, {"own_uv": own_uv})
        # A simplified mesh is sent in full, too, for painting and drawing, up to 4 million triangles.
        if content.left_out and len(result.faces) <= 4_000_000:
            head, block = with_all_triangles(head, block, self._model, result)
        head["notes"] = []
        if pins.pins:
            assert self._base is not None
            unpinned = self._base
            head["places"] = list(places_of_charts(unpinned, result, pins, content.face_numbers))
        cones = result.cones if result.vertex_origin is None else result.vertex_origin[result.cones]
        data = {"head": with_hashes(head, block), "found": cones.tolist(), "seconds": result.seconds}
        return data, block

    def _open(self, mesh: str, sha256: str, report: Callable[[str, float], None]) -> Opened:
        """Return the mesh of a job, which is read if it is another one than before."""
        if self._opened is None or self._read != (mesh, sha256):
            report("read", 0.0)
            self._opened = self._model = self.quads = None  # The memory may not suffice for both.
            self._layouts, self._unpinned, self._base = LatestLayouts(), LatestCache(), None
            repaired.cache_clear()
            source = read_joined(Path(mesh))
            self._opened = Opened(source, Flattener(source.mesh), Unwrapper(source.mesh))
            self._read = mesh, sha256
            self._own_texture = (
                None
                if source.mesh.scene is None
                else own_picture(source.mesh, DECLARED["resolution"].default)
            )
        return self._opened


def _answer(saved: SavedFile) -> tuple[Head, bytes]:
    return {"notes": [page_message(note) for note in saved.notes]}, saved.content


def _text_of_preview(first: Flattening) -> PageText:
    """Return the title and the rows of a preview, which has no numbers."""
    return PageText(
        FIRST_TITLE, [(measure, PLACEHOLDER, meaning) for measure, _, meaning in shown_rows(first)]
    )


def with_all_triangles(head: Head, block: bytes, model: Model, result: Flattening) -> tuple[Head, bytes]:
    """Return the page data of a result with all vertices and triangles of its mesh added."""

    arrays = {
        "whole_places": model.places.astype(np.float32),
        "whole_faces": np.searchsorted(model.vertices, model.mesh.faces).astype(np.uint32),
    }
    numbers = model.vertices if result.vertex_origin is None else result.vertex_origin[model.vertices]
    if not np.array_equal(numbers, np.arange(len(numbers))):
        arrays["whole_numbers"] = numbers.astype(np.int32)
    return with_arrays(head, block, arrays)


def with_arrays(head: Head, block: bytes, arrays: Mapping[str, NDArray[Any]]) -> tuple[Head, bytes]:
    """Return page data with more arrays."""
    listed, added = pack(arrays)
    moved = [{**entry, "offset": entry["offset"] + len(block)} for entry in listed]
    return {**head, "arrays": [*head["arrays"], *moved]}, block + added


def serve(jobs: Jobs, answers: IO[bytes]) -> None:
    """Run jobs until the last one."""
    bench = JobRunner()
    while (job := jobs.next()) is not None:
        number = job["job"]

        def check_current(job: Head = job) -> None:
            if jobs.is_stale(job):
                raise Superseded

        def report(stage: str, fraction: float, number: int = number) -> None:
            check_current()
            write_frame(answers, {"job": number, "stage": stage, "fraction": fraction})

        def show(head: Head, body: bytes, number: int = number) -> None:
            check_current()
            write_frame(answers, {"job": number, "early": head}, body)

        def tell(kind: str, head: Mapping[str, Any], body: bytes, number: int = number) -> None:
            write_frame(answers, {"job": number, kind: head}, body)

        try:
            with cancel_with(check_current):
                head, body = (
                    bench.flatten(job, report, show, tell)
                    if job["do"] == "flatten"
                    else bench.make(job, report)
                )
            write_frame(answers, {"job": number, "done": head}, body)
        except Superseded:
            reason = "cancelled" if jobs.is_cancelled(job) else "superseded"
            write_frame(answers, {"job": number, "given_up": reason})
        except ConeflatError as error:
            # The page offers a button for errors that a repair can fix.
            mends = isinstance(error, (DegenerateFaceError, NonManifoldError, NonOrientableError))
            head, body = bench.bare(job) if job.get("bare") else ({}, b"")
            told = {"job": number, "error": page_message(str(error)), "repair": mends, "bare": head}
            write_frame(answers, told, body)
        except Exception as error:
            message = f"internal error, please report it: {type(error).__name__}: {error}"
            if isinstance(error, MemoryError):
                message = "not enough memory for this mesh"
            write_frame(answers, {"job": number, "error": message, "again": True})


def main() -> None:
    """Serve over standard input and output; what libraries print is redirected to standard error."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    # The page shows the notes. The pipe is broken if the studio was killed.
    with inner_calls(), suppress(BrokenPipeError):
        serve(Jobs(sys.stdin.buffer), answers)


if __name__ == "__main__":
    main()
