"""From a file to a file, with progress and a table at the end."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..errors import OptionError
from ..io import atomic_write, check_output, read_mesh
from ..io.atomic import check_target
from ..pipeline import flatten
from ..result import Flattening
from ..stages import Stages
from .console import Console


def run(
    mesh: Path,
    output: Path | None,
    options: Mapping[str, Any],
    *,
    weld: bool | None = None,
    report: Path | None = None,
    texture: str | None = None,
    quiet: bool = False,
) -> Flattening:
    """Flatten a mesh file, write the result and its report, and print what came out.

    Args:
        mesh: file to read.
        output: file to write; None for one beside the current folder's others, named after the input.
        options: keyword arguments of `coneflat.flatten`.
        weld: merge vertices at the same position; None for the format's default.
        report: JSON file for the measures.
        texture: of a .glb: "checker", or an image file.
        quiet: print nothing.
    """
    output = Path(f"{mesh.stem}_uv.obj") if output is None else output
    # What can fail at the end is looked at before the work.
    check_output(output, texture)
    if report is not None:
        check_target(report)
    _require_distinct({"input": mesh, "output": output, "report": report})

    with Console(quiet) as console:
        stages = Stages(console.progress)
        with stages("read"):
            source = read_mesh(mesh, weld)
        result = flatten(source, progress=console.progress, **options)
        stages.seconds.update(result.seconds)
        if source.welded:
            note = f"Merged {source.welded:,} vertices at the same positions."
            result = replace(result, notes=(note, *result.notes))
        stages.done = 1.0
        with stages("write"):
            result.save(output, texture=texture)
        result = replace(result, seconds=dict(stages.seconds))
        if report is not None:
            with atomic_write(report, "w") as file:
                json.dump(result.report(), file, indent=2)
                file.write("\n")
        console.finish(result, [path for path in (output, report) if path is not None])
    return result


def _require_distinct(files: Mapping[str, Path | None]) -> None:
    """Raise OptionError if two names mean one file, of which one would overwrite the other."""
    seen: dict[str, str] = {}
    for role, path in files.items():
        if path is None:
            continue
        where = os.path.normcase(os.path.realpath(path))
        if where in seen:
            raise OptionError(
                f"{path} is the {seen[where]} and the {role}: choose another name for one of them"
            )
        seen[where] = role
