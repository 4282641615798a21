"""What gives the same result without the studio: a command line, and Python."""

from __future__ import annotations

import shlex
from typing import Any

from .choices import Choices
from .paint import Region

#: Numbers that are written one by one.
FEW = 12


def replay(mesh: str, project: str, choices: Choices) -> dict[str, str]:
    """Return what makes the same layout without the studio: the command line, and Python."""
    return {"command": command_line(mesh, project, choices), "python": python_lines(mesh, choices)}


def command_line(mesh: str, project: str, choices: Choices) -> str:
    """Return a command that flattens a mesh by what was chosen; what was drawn or painted needs the project's file."""
    if choices.cuts or choices.kept or choices.paint:
        return shlex.join(["coneflat", "flatten", "--project", project])
    parts = ["coneflat", "flatten", mesh]
    for name, value in choices.keywords().items():
        flag = "--" + name.replace("_", "-")
        if name == "repair":
            parts += ["--repair"] if value else []
        elif name == "required_cones":
            parts += [flag, ",".join(str(vertex) for vertex in value)]
        elif isinstance(value, dict):
            parts += [flag, ",".join(_cone(vertex, curvature) for vertex, curvature in value.items())]
        else:
            parts += [flag, repr(value) if isinstance(value, float) else str(value)]
    return shlex.join(parts)


def python_lines(mesh: str, choices: Choices) -> str:
    """Return Python that flattens a mesh by what was chosen."""
    given = [f"    {name}={_written(value)}," for name, value in choices.keywords().items()]
    if sum(map(len, given)) > 20_000:  # letters in the panel
        return "# What was drawn or painted is too much to be written here; the project's file has it."
    call = "\n".join([f"result = coneflat.flatten(\n    {mesh!r},", *given, ")"])
    return f"import coneflat\n\n{call}"


def _cone(vertex: int, curvature: float | None) -> str:
    return str(vertex) if curvature is None else f"{vertex}:{curvature!r}"


def _written(value: Any) -> str:
    if hasattr(value, "tolist"):
        return repr(value.tolist())
    if isinstance(value, tuple):
        return f"({', '.join(_written(each) for each in value)})"
    if isinstance(value, list) and len(value) > FEW:
        return f"[{_ranges(value)}]"
    if isinstance(value, dict) and len(value) > FEW:
        # Those that have one value are together.
        groups: dict[Any, list[int]] = {}
        for vertex, each in value.items():
            groups.setdefault(each, []).append(vertex)
        if len(groups) <= FEW:
            parts = (
                f"**dict.fromkeys([{_ranges(sorted(group))}], {each!r})" for each, group in groups.items()
            )
            return f"{{{', '.join(parts)}}}"
    return repr(value)


def _ranges(vertices: list[int]) -> str:
    """Return vertices, ascending, as they stand in brackets: those that follow each other as a range."""
    runs = Region.of_runs((vertex, vertex) for vertex in vertices).runs
    return ", ".join(str(a) if a == b else f"*range({a}, {b + 1})" for a, b in runs)
