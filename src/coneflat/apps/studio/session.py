"""Sessions: what the user edits, and files, quads and curves on request, independent of the web server."""

from __future__ import annotations

from hashlib import sha256
from typing import Any

from ...base import short_repr
from ...errors import StudioError
from .editing import Editing
from .outputs import QUAD_FORMATS, RESULT_FILES, curve_options, quads_job
from .requests import MadeQuads
from .worker import Head


class Session(Editing):
    """The state of the studio. All methods are thread-safe."""

    def __init__(self, *arguments: Any, **keywords: Any) -> None:
        """Arguments: those of `Editing`."""
        super().__init__(*arguments, **keywords)
        self._quads = MadeQuads()
        self._curves: dict[tuple[str, str], dict[str, Any]] = {}

    def state(self, received: int = 0) -> dict[str, Any]:
        """Return the state as values for JSON, with the number of the quads of the choices; 0 if there are none."""
        with self._changed:
            quads = self._quads.number if self._quads.job == self._job else 0
            return {**super().state(received), "quads": quads}

    def export(self, ending: str) -> bytes:
        """Return the content of a file of the result; the notes on it become warnings of the state.

        Raises:
            StudioError: there is no result, or the format is unknown.
        """
        if ending not in RESULT_FILES:
            raise StudioError(f"unknown format {short_repr(ending)}: choose from {', '.join(RESULT_FILES)}")
        return self._saved({"do": "export", "ending": ending})

    def make_quads(self, count: object) -> None:
        """Compute approximately `count` quads, whose page is `quads_page`; a change of the choices cancels this.

        Raises:
            StudioError: no mesh is open, or the choices were changed.
            Cancelled: the user has cancelled it.
            OptionError: the number is not an integer.
        """
        head, page = self._request(quads_job(count))
        with self._changed:
            self._quads = MadeQuads(self._quads.number + 1, self._job, page)
            self._saved_notes = self._display.current.job, tuple(head["notes"])
            self._notify()

    def quads_page(self) -> bytes:
        """Return the page of the quads that were computed last, HTML.

        Raises:
            StudioError: there are none for the present choices.
        """
        with self._changed:
            if self._quads.job != self._job:
                raise StudioError("there are no quads of these settings: compute them first")
            return self._quads.page

    def save_quads(self, ending: str) -> bytes:
        """Return a file of the quads that were computed last.

        Raises:
            StudioError: there are none for the present choices, or the format is unknown.
        """
        if ending not in QUAD_FORMATS:
            raise StudioError(
                f"unknown format {short_repr(ending)} of quads: choose from {', '.join(QUAD_FORMATS)}"
            )
        self.quads_page()
        return self._saved({"do": "quads file", "ending": ending})

    def curve(self) -> dict[str, Any]:
        """Return the distortion for each number of cones, see `curve_data`; a change of the choices cancels it.

        Raises:
            StudioError: no mesh is open, or the choices were changed.
        """
        with self._changed:
            key = self._project.sha256, sha256(repr(curve_options(self._history.now)).encode()).hexdigest()
            if key not in self._curves:
                self._curves[key] = self._request({"do": "curve"})[0]
            return self._curves[key]

    def _saved(self, job: Head) -> bytes:
        """Return the content of a file that the worker makes, and store the notes on it."""
        head, content = self._request(job)
        with self._changed:
            self._saved_notes = self._display.current.job, tuple(head["notes"])
            self._notify()
        return content
