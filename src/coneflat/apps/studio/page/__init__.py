"""The page of the studio: the page of the viewer with further scripts and controls."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import cache
from importlib.resources import files

from ...controls import control_of
from ...view import page_around
from ..choices import DECLARED, FURTHER_OPTIONS, PLAIN_OPTIONS
from ..outputs import RESULT_FILES

#: Content security policy: only connections to the server of the page are allowed.
POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'"
)
# In the order in which they must run; they share one scope.
_SCRIPTS = (
    "server", "surface", "graph", "paint", "tools", "overlay", "align", "sizes", "curve", "quads", "charts", "work",
    "panel", "studio",
)  # fmt: skip


@cache
def studio_page(formats: Sequence[str]) -> str:
    """Return the page as text; formats: extensions of meshes that can be dropped on it."""
    defaults = {name: DECLARED[name].default for name in PLAIN_OPTIONS}
    uses = {"Texture": "for-texture", "Cones": "for-angles", "Metric": "for-angles"}
    further = [
        {**control_of(DECLARED[name]), "label": label, "use": uses.get(DECLARED[name].group, "")}
        for name, label in FURTHER_OPTIONS.items()
    ]
    files = [
        {"ending": ending[1:], "label": file.label, "title": file.title, "stem": file.stem}
        for ending, file in RESULT_FILES.items()
    ]
    constants = "".join(
        f"const {name} = {json.dumps(value)};"
        for name, value in (("DEFAULTS", defaults), ("FURTHER_OPTIONS", further), ("RESULT_FILES", files))
    )
    scripts = [constants, *(_read(f"{name}.js") for name in _SCRIPTS)]
    return page_around(
        POLICY,
        "",
        script="\n".join(scripts),
        style=_read("studio.css"),
        panel=_read("panel.html").replace("{{formats}}", ",".join((*formats, ".json"))),
        keys=_read("keys.html"),
    )


def _read(name: str) -> str:
    return (files(__package__) / name).read_text(encoding="utf-8")
