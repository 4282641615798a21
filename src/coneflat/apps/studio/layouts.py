"""The latest layouts of a mesh, by the choices for them: undoing and redoing steps computes nothing."""

from __future__ import annotations

import json
from collections import OrderedDict
from hashlib import sha256
from typing import NamedTuple

from ... import Flattening
from .worker import Head

#: Largest number of layouts that are kept, and of the triangles of all of them: 97,000 take 5 to 10 MB.
MAX_LAYOUTS, MAX_TRIANGLES = 10, 4_000_000


class MadeLayout(NamedTuple):
    """A result, and its page data: numbers and texts, and the bytes of arrays."""

    result: Flattening
    head: Head
    body: bytes


class LatestLayouts:
    """The layouts of one mesh that were made or asked for last; older ones are dropped."""

    def __init__(self) -> None:
        self._layouts: OrderedDict[str, MadeLayout] = OrderedDict()

    def get(self, job: Head) -> MadeLayout | None:
        """Return the layout of a job; None if it is not among the latest."""
        key = _key(job)
        if key in self._layouts:
            self._layouts.move_to_end(key)
        return self._layouts.get(key)

    def put(self, job: Head, layout: MadeLayout) -> None:
        """Store the layout of a job; the latest one stays, whatever its size."""
        self._layouts[_key(job)] = layout
        triangles = len(layout.result.faces)
        while len(self._layouts) > max(1, min(MAX_LAYOUTS, MAX_TRIANGLES // triangles)):
            self._layouts.popitem(last=False)


def _key(job: Head) -> str:
    """Return a text that is the same for jobs with the same layout and look; units of length change neither."""
    choices = {name: value for name, value in job["choices"].items() if name != "units"}
    text = json.dumps([choices, job.get("color"), job.get("most")], sort_keys=True)
    return sha256(text.encode("ascii")).hexdigest()
