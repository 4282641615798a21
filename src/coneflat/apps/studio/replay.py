"""What gives the same result without the studio: a command line, and Python."""

from __future__ import annotations

import shlex
from typing import Any

from .choices import Choices

WIDTH = 100


def command_line(mesh: str, project: str, choices: Choices) -> str:
    """Return a command that flattens a mesh by what was chosen; drawn seams need the project's file."""
    words = choices.keywords()
    if "seams" in words or "forbidden_seams" in words:
        return shlex.join(["coneflat", "flatten", "--project", project])
    parts = ["coneflat", "flatten", mesh]
    for name, value in words.items():
        flag = "--" + name.replace("_", "-")
        if name == "repair":
            parts += ["--repair"] if value else []
        elif name in ("required_cones", "allowed_cones"):
            parts += [flag, ",".join(str(vertex) for vertex in value)]
        elif isinstance(value, dict):
            parts += [flag, ",".join(_cone(vertex, curvature) for vertex, curvature in value.items())]
        else:
            parts += [flag, repr(value) if isinstance(value, float) else str(value)]
    return shlex.join(parts)


def python_lines(mesh: str, choices: Choices) -> str:
    """Return Python that flattens a mesh by what was chosen."""
    given = [f"    {name}={_written(value)}," for name, value in choices.keywords().items()]
    call = "\n".join([f"result = coneflat.flatten(\n    {mesh!r},", *given, ")"])
    return f"import coneflat\n\n{call}"


def _cone(vertex: int, curvature: float | None) -> str:
    return str(vertex) if curvature is None else f"{vertex}:{curvature!r}"


def _written(value: Any) -> str:
    return repr(value.tolist() if hasattr(value, "tolist") else value)
