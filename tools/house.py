"""The house: which rooms there are, and who imports whom. `python tools/house.py` draws it into docs/how-it-works.md.

Rooms stand on floors. A file imports from its own floor and from those below.
"""

from __future__ import annotations

import ast
from dataclasses import dataclass
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1] / "src" / "coneflat"

#: Rooms, from the ground up; a room is a folder, or a file beside them.
FLOORS: tuple[tuple[str, ...], ...] = (
    ("", "errors", "text"),
    ("_arrays", "compiled", "threads", "progress"),
    ("mesh", "options"),
    ("geometry", "solver"),
    ("quality", "seams"),
    ("input",),
    ("cones", "layout"),
    ("flat",),
    ("atlas",),
    ("result",),
    ("pipeline", "curve"),
    ("files", "view"),
    ("sample", "ahead", "apps"),
    ("__main__",),
)


@dataclass(frozen=True)
class Module:
    """A file of the package.

    Attributes:
        name: without the package's, "" for the package itself.
        path: the file.
        imports: modules of the package that it imports when it is loaded.
        late_imports: those that functions of it import when they are called.
    """

    name: str
    path: Path
    imports: frozenset[str]
    late_imports: frozenset[str]


def floor_of(name: str) -> int | None:
    """Return the floor that a module is on, from 0; None for a room that has none."""
    room = name.partition(".")[0]
    return next((i for i, rooms in enumerate(FLOORS) if room in rooms), None)


def read_modules(package: Path = PACKAGE) -> dict[str, Module]:
    """Return the modules of a package by name; what only type checkers import does not count."""
    paths = {}
    for path in sorted(package.rglob("*.py")):
        parts = path.relative_to(package).with_suffix("").parts
        paths[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return {name: _read(name, path, paths) for name, path in paths.items()}


def _read(name: str, path: Path, paths: dict[str, Path]) -> Module:
    now, late = set[str](), set[str]()
    package = name.split(".") if path.stem == "__init__" else name.split(".")[:-1]
    package = [part for part in package if part]

    def walk(node: ast.AST, inside: bool) -> None:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING":
                continue
            if isinstance(child, ast.ImportFrom) and child.level:
                base = package[: len(package) - child.level + 1] + (child.module or "").split(".")
                home = ".".join(part for part in base if part)
                for alias in child.names:
                    full = f"{home}.{alias.name}".strip(".")
                    (late if inside else now).add(full if full in paths else home)
            walk(child, inside or isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)))

    walk(ast.parse(path.read_text(encoding="utf-8")), False)
    return Module(name, path, frozenset(now - {name}), frozenset(late - now - {name}))
