"""What a session shows: the last layout, a preview of the next one, or the mesh without a layout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from .worker import Head, SentPictures


class ShownLayout(NamedTuple):
    """What is shown.

    Attributes:
        picture: page data: numbers and texts, and arrays; None if nothing is shown.
        cones: vertices of the cones.
        seconds: seconds per stage.
        warnings: sentences on the layout.
        job: number of its flattening.
        is_bare: whether it is a mesh without a layout.
        on_controls: notes on values of controls that are not met, by their option.
    """

    picture: tuple[Head, bytes] | None = None
    cones: Sequence[int] = ()
    seconds: Mapping[str, float] = MappingProxyType({})
    warnings: Sequence[str] = ()
    job: int = 0
    is_bare: bool = False
    on_controls: Mapping[str, str] = MappingProxyType({})


class Display:
    """What is shown, and the last final layout while a preview is shown.

    Attributes:
        current: what is shown.
        number: number of what was shown last, which is unique.
        is_early: whether it is a preview, which the final layout will replace.
    """

    def __init__(self) -> None:
        self.current = ShownLayout()
        self.number = 0
        self.is_early = False
        self._last: ShownLayout | None = None
        self._sent = SentPictures()

    def clear(self) -> None:
        """Show nothing; the times of the last layout stay."""
        self.current = ShownLayout(seconds=self.current.seconds)
        self.is_early, self._last = False, None

    def show_bare(self, data: Head, body: bytes, job: int) -> None:
        """Show the mesh of a job without a layout."""
        self._show(data, body, job, is_bare=True)

    def show_early(self, data: Head, body: bytes, job: int) -> None:
        """Show a preview of the layout of a job."""
        self._last = self._last or self.current
        self._show(data, body, job)
        self.is_early = True

    def show_final(self, data: Head, body: bytes, job: int) -> None:
        """Show the layout of a job."""
        self._show(data, body, job)
        self.is_early, self._last = False, None

    def restore(self) -> None:
        """Show the last final layout instead of a preview."""
        if self.is_early and self._last is not None and self._last.picture is not None:
            self.current = self._last
            self.number += 1
            self.is_early, self._last = False, None

    def picture(self, received: int) -> tuple[Head, bytes] | None:
        """Return the page data of what is shown, without the arrays that those of the number `received` contain."""
        picture = self.current.picture
        return None if picture is None else self._sent.without(received, picture)

    def _show(self, data: Head, body: bytes, job: int, is_bare: bool = False) -> None:
        self.number += 1
        self.current = ShownLayout(
            self._sent.numbered((data["head"], body)),
            data["found"],
            data["seconds"],
            data.get("warnings", ()),
            job,
            is_bare,
            data.get("on_controls", {}),
        )
