"""Face lines of an OBJ file, compiled."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .._arrays import IntArray
from ..geometry.compiled import compiled
from .decimal_kernel import BLANK, put_integer

LETTER_F, SLASH = ord("f"), ord("/")


@compiled
def put_faces(sizes: IntArray, rows: IntArray, end: NDArray[np.uint8], out: NDArray[np.uint8]) -> int:
    """Write a line for each face, and return the length of the text.

    Args:
        sizes: (p,) the number of corners of each face.
        rows: (c, k) numbers of each corner, to stand between slashes; a 0 at the end is left out.
        end: how a line ends.
        out: where the text goes, large enough.
    """
    i, corner = 0, 0
    for size in sizes:
        out[i] = LETTER_F
        i += 1
        for _ in range(size):
            out[i] = BLANK
            i = put_integer(out, i + 1, rows[corner, 0])
            for number in rows[corner, 1:]:
                if number != 0:
                    out[i] = SLASH
                    i = put_integer(out, i + 1, number)
            corner += 1
        for code in end:
            out[i] = code
            i += 1
    return i
