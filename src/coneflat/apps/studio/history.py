"""Undo and redo, as far back as the session goes."""

from __future__ import annotations

from .choices import Choices


class History:
    """What was chosen before, what is chosen now, and what was undone.

    Attributes:
        now: what is chosen.
    """

    def __init__(self, now: Choices) -> None:
        self.now = now
        self._past: list[Choices] = []
        self._undone: list[Choices] = []
        self._stroke: object = None

    def change(self, to: Choices, stroke: object = None) -> bool:
        """Take a step, and return whether it changes anything; steps of one stroke, as of a drag, are one."""
        if to == self.now:
            return False
        if stroke is None or stroke != self._stroke:
            self._past.append(self.now)
        self._stroke = stroke
        self.now = to
        self._undone.clear()
        return True

    def undo(self) -> bool:
        """Go a step back, and return whether there was one."""
        return self._go(self._past, self._undone)

    def redo(self) -> bool:
        """Take the step that was undone last, and return whether there was one."""
        return self._go(self._undone, self._past)

    def _go(self, source: list[Choices], target: list[Choices]) -> bool:
        self._stroke = None
        if not source:
            return False
        target.append(self.now)
        self.now = source.pop()
        return True

    @property
    def depth(self) -> tuple[int, int]:
        """How many steps there are to undo, and to redo."""
        return len(self._past), len(self._undone)
