"""Arrays of which one block comes after the other."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


class Growing:
    """Rows that come in blocks, in one array that grows in place.

    Blocks kept and joined at the end would take twice the memory, and leave half of it in pieces too small for
    anything large afterwards.
    """

    def __init__(self, kind: type[np.generic], *columns: int) -> None:
        """Begin with no rows, of so many columns; of none if there is but one number to a row."""
        self._rows: NDArray[Any] = np.empty((0, *columns), kind)
        self._length = 0

    def __len__(self) -> int:
        return self._length

    def add(self, rows: NDArray[Any]) -> None:
        """Append some rows."""
        end = self._length + len(rows)
        if end > len(self._rows):
            self._resize(max(end, 2 * len(self._rows)))
        self._rows[self._length : end] = rows
        self._length = end

    def done(self) -> NDArray[Any]:
        """Return all rows."""
        self._resize(self._length)
        return self._rows

    def _resize(self, length: int) -> None:
        # Nobody else has seen the array yet, so that it may move.
        self._rows.resize((length, *self._rows.shape[1:]), refcheck=False)
