"""Page data without the arrays that the page has already; most of them do not change when a cone is moved."""

from __future__ import annotations

from collections import OrderedDict
from hashlib import blake2b
from typing import Any

from .worker import Head

Picture = tuple[Head, bytes]


def with_hashes(head: Head, block: bytes) -> Head:
    """Return the head of page data with a hash of each of its arrays, by which equal arrays are recognised."""
    view = memoryview(block)
    # With 16 bytes, hashes of different arrays do not collide by chance.
    arrays = [
        {**each, "print": blake2b(view[slice(*_span(each))], digest_size=16).hexdigest()}
        for each in head["arrays"]
    ]
    return {**head, "arrays": arrays}


class SentPictures:
    """The hashes of the arrays in the last page data that were sent, by their numbers."""

    def __init__(self) -> None:
        self._count = 0
        self._hashes: OrderedDict[int, dict[str, str]] = OrderedDict()

    def numbered(self, picture: Picture) -> Picture:
        """Return page data with a new number, from 1 on, and store the hashes of its arrays."""
        head, block = picture
        self._count += 1
        self._hashes[self._count] = {each["name"]: each["print"] for each in head["arrays"]}
        if len(self._hashes) > 16:  # The page is never further behind than this.
            self._hashes.popitem(last=False)
        return {**head, "number": self._count}, block

    def without(self, number: int, picture: Picture) -> Picture:
        """Return page data without the arrays that those of a number contain, too; the offset of these is None."""
        head, block = picture
        hashes = self._hashes.get(number, {})
        arrays, parts, offset = [], [], 0
        for each in head["arrays"]:
            if hashes.get(each["name"]) == each["print"]:
                arrays.append({**each, "offset": None})
                continue
            begin, end = _span(each)
            end += -end % 4  # Arrays are aligned to 4 bytes in the block.
            arrays.append({**each, "offset": offset})
            parts.append(memoryview(block)[begin:end])
            offset += end - begin
        return {**head, "arrays": arrays}, b"".join(parts)


def _span(listed: dict[str, Any]) -> tuple[int, int]:
    """Return the begin and the end of an array in its block."""
    return listed["offset"], listed["offset"] + int(listed["type"][1:]) * listed["count"]
