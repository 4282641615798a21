"""From a file to a result, and to files, with progress and a table at the end."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import IO, Any

from ... import Flattening, flatten, read_flattening
from ...errors import OptionError
from ...io import (
    PIPE,
    Joined,
    as_written,
    atomic_write,
    check_output,
    check_target,
    has_uv,
    read_joined,
    write_measured,
    write_stream,
)
from ...measure import Requirement
from .console import Console
from .shared import check_required, checking

READ, FLATTENED = 0.03, 0.92
"""Fractions of the whole that are done when the mesh is read, and when it is flattened, about."""

AGAIN = "--again flattens the mesh anew"


def run(
    mesh: Path,
    output: Path | None,
    options: Mapping[str, Any],
    *,
    weld: bool | None = None,
    report: Path | None = None,
    texture: str | None = None,
    verbosity: str | None = None,
    ending: str = ".obj",
    requirements: Sequence[Requirement] = (),
    noted: Callable[[Flattening], Flattening] | None = None,
) -> None:
    """Flatten a mesh file, write the result and its report, and print what came out.

    Args:
        mesh: file to read.
        output: file to write, "-" for standard output; None for a file in the current folder that is named after the
            input, or standard output for what comes from standard input.
        options: keyword arguments of `coneflat.flatten`.
        weld: merge vertices at the same position; None for the default, see `read_joined`.
        report: JSON file for the measures.
        texture: of a .glb: "checker", or an image file.
        verbosity: how much to print, see `verbosity_options`.
        ending: format of what goes to standard output, or of a file without a name.
        requirements: what measures must be; the files are written in any case.
        noted: gives a result with more notes.
    """
    output = named_output(mesh, ending) if output is None else output
    # What can fail at the end is looked at before the work.
    check_output(Path(f"stdout{ending}") if output == PIPE else output, texture)
    if report is not None:
        check_target(report)
    require_distinct({"input": mesh, "output": output, "report": report})

    with _kept_apart(output) as stdout, Console(verbosity) as console:
        result = flatten_file(mesh, console, options, weld)
        result = result if noted is None else noted(result)
        result = save(result, console, output, report, texture, stdout, ending)
        console.finish([path for path in (output, report) if path is not None and path != PIPE], result)
    check_required(requirements, result.report(), str(output))


def named_output(mesh: Path, ending: str) -> Path:
    """Return the file that the result of a mesh is written to if none is named."""
    return PIPE if mesh == PIPE else Path(f"{mesh.stem}_uv{ending}")


@contextmanager
def _kept_apart(output: Path) -> Iterator[IO[bytes] | None]:
    """Yield standard output if the result goes there, and let everything else that is printed go to stderr."""
    if output != PIPE:
        yield None
        return
    stdout = sys.stdout.buffer
    if stdout is getattr(sys.__stdout__, "buffer", None):
        # Libraries that print of themselves write to the descriptor.
        stdout = os.fdopen(os.dup(1), "wb")
        os.dup2(2, 1)
    with redirect_stdout(sys.stderr):
        yield stdout


def open_result(
    file: Path, console: Console, *, again: bool = False, repair: bool = True, weld: bool | None = None
) -> Flattening:
    """Return the result that a .npz file holds, the UVs of a mesh, or the mesh flattened without overlaps.

    again: flatten a mesh that has UVs, too.
    """
    with console.stage("read", 0.0):
        if file.suffix.lower() == ".npz":
            return read_flattening(file)
        source = read_joined(file, weld)
    if not again and has_uv(source.mesh):
        from ..view.from_uv import own_flattening

        with console.stage("measure", READ):
            own = own_flattening(source, strict=not repair)
        if own is not None:
            return replace(own, notes=(f"Shown are the UVs that {file.name} has; {AGAIN}.", *own.notes))
    return flatten_joined(source, console, {"charts": "atlas", **checking(repair)})


def archive_of(file: Path) -> Path | None:
    """Return the file if it is a result's archive, which may have arrays more."""
    return file if file.suffix.lower() == ".npz" else None


def flatten_file(
    mesh: Path, console: Console, options: Mapping[str, Any], weld: bool | None = None
) -> Flattening:
    """Return the result of a mesh file, and show how it is made."""
    with console.stage("read", 0.0):
        source = read_joined(mesh, weld)
    return flatten_joined(source, console, options)


def flatten_joined(source: Joined, console: Console, options: Mapping[str, Any]) -> Flattening:
    """Return the result of a mesh that was read, and show how it is made."""
    result = flatten(source.mesh, progress=console.part(READ, FLATTENED), **source.renamed(options))
    console.seconds.update(result.seconds)
    return replace(result, notes=source.notes_of(result.notes))


def save(
    result: Flattening,
    console: Console,
    output: Path,
    report: Path | None,
    texture: str | None = None,
    stdout: IO[bytes] | None = None,
    ending: str = ".obj",
) -> Flattening:
    """Write a result and its report, and return it as it was written, with the time that everything took.

    stdout: where the result goes, as of an ending, instead of to the output.
    """
    with console.stage("write", FLATTENED):
        if stdout is None:
            result = write_measured(result, output, texture)
        else:
            # Whole or not at all, as files are.
            content = BytesIO()
            result = as_written(write_stream(result, content, ending, texture), ending)
            stdout.write(content.getbuffer())
            stdout.flush()
    result = replace(result, seconds=dict(console.seconds))
    if report is not None:
        write_report(report, result.report())
    return result


def write_report(path: Path, report: Mapping[str, Any]) -> None:
    """Write measures as JSON."""
    with atomic_write(path, "w") as file:
        json.dump(report, file, indent=2)
        file.write("\n")


def require_distinct(files: Mapping[str, Path | None]) -> None:
    """Raise OptionError if two names mean one file, of which one would overwrite the other."""
    seen: dict[str, str] = {}
    for role, path in files.items():
        if path is None or path == PIPE:
            continue
        where = os.path.normcase(os.path.realpath(path))
        if where in seen:
            raise OptionError(
                f"{path} is the {seen[where]} and the {role}: choose another name for one of them"
            )
        seen[where] = role
