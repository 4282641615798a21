"""Pictures without the arrays that the page has from one before: most of a model stays as it is when a cone moves."""

from __future__ import annotations

from collections import OrderedDict
from hashlib import blake2b
from typing import Any

from .worker import Head

Picture = tuple[Head, bytes]


def with_prints(head: Head, block: bytes) -> Head:
    """Return the head of a picture with a print of each of its arrays, by which the same are known."""
    view = memoryview(block)
    # 16 bytes: two arrays never have the same print by chance.
    arrays = [
        {**each, "print": blake2b(view[slice(*_span(each))], digest_size=16).hexdigest()}
        for each in head["arrays"]
    ]
    return {**head, "arrays": arrays}


class Known:
    """What was in the last pictures; each has a number, which no other one gets."""

    def __init__(self) -> None:
        self._count = 0
        self._prints: OrderedDict[int, dict[str, str]] = OrderedDict()

    def numbered(self, picture: Picture) -> Picture:
        """Return a picture that has prints with a number, from 1 on."""
        head, block = picture
        self._count += 1
        self._prints[self._count] = {each["name"]: each["print"] for each in head["arrays"]}
        if len(self._prints) > 16:  # pictures: more than the page can be behind by
            self._prints.popitem(last=False)
        return {**head, "number": self._count}, block

    def without(self, number: int, picture: Picture) -> Picture:
        """Return a picture without the arrays that the one of a number has, too; these have no place in it."""
        head, block = picture
        prints = self._prints.get(number, {})
        arrays, parts, offset = [], [], 0
        for each in head["arrays"]:
            if prints.get(each["name"]) == each["print"]:
                arrays.append({**each, "offset": None})
                continue
            begin, end = _span(each)
            end += -end % 4  # as arrays lie in the block
            arrays.append({**each, "offset": offset})
            parts.append(memoryview(block)[begin:end])
            offset += end - begin
        return {**head, "arrays": arrays}, b"".join(parts)


def _span(listed: dict[str, Any]) -> tuple[int, int]:
    """Return where an array begins and ends in its block."""
    return listed["offset"], listed["offset"] + int(listed["type"][1:]) * listed["count"]
