"""The list of measures in the documentation, made from the docstring of `coneflat.Distortion`."""

from __future__ import annotations

import inspect
import re

from coneflat import Distortion
from coneflat.measures.report import MEASURES


def measure_list() -> str:
    """Return the measures and their meanings as a list."""
    documented = inspect.cleandoc(Distortion.__doc__ or "").partition("Attributes:\n")[2].partition("\n\n")[0]
    entries = re.findall(r"^    (\w+(?:, \w+)*): (.*(?:\n {8}.*)*)", documented, re.MULTILINE)
    lines = []
    for names, meaning in entries:
        if set(names.split(", ")) <= set(MEASURES):
            spelled = ", ".join(f"`{name}`" for name in names.split(", "))
            lines.append(f"- {spelled}: {' '.join(meaning.split()).rstrip('.')}")
    return "\n".join(lines)
