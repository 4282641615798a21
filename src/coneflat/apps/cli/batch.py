"""`coneflat batch`."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from ...base import plural, printable
from ...options import FORMATS, Options, read_options
from .options import (
    check_combinations,
    chosen,
    flag,
    flag_of,
    keywords,
    option_flags,
    paper_option,
    path_flag,
)
from .shared import GroupedCommand, input_options, require_option, verbosity_options


@dataclass(frozen=True, kw_only=True)
class BatchFlags:
    """Output.

    Attributes:
        out: Folder for the results, the journal and the summary; it is made if need be.
        format: What to write.
        summary: A .csv file.  [default: summary.csv in --out]
        jobs: Processes on this machine.  [default: as many as there are cores]
        time_limit: Seconds per mesh, after which it has failed.
        dask: Work on the cluster of this Dask scheduler, tcp://host:8786 say.
        redo: Flatten again what is done.
    """

    out: Path = path_flag(required=True)
    format: str = flag("obj", type=click.Choice(FORMATS))
    summary: Path | None = path_flag()
    jobs: int | None = flag(type=int)
    time_limit: float = flag(3600.0, type=float)
    dask: str | None = flag(metavar="ADDRESS")
    redo: bool = flag(False, is_flag=True)


@click.command(cls=GroupedCommand, short_help="Flatten many meshes, on this machine or on a Dask cluster.")
@click.argument("patterns", metavar="PATTERN...", nargs=-1, required=True)
@option_flags(BatchFlags)
@paper_option
@option_flags(Options, one_mesh=False)
@input_options
@require_option
@verbosity_options
@click.pass_context
def batch(
    context: click.Context,
    /,
    patterns: tuple[str, ...],
    weld: bool | None,
    required: tuple[str, ...],
    verbosity: str | None,
    **given: Any,
) -> None:
    """Flatten all meshes that the patterns name: files, folders, or *, ? and ** in quotes.

    A mesh that fails does not stop the rest; a further run goes on with what is not done.

    \b
    Examples:
      coneflat batch models --out flat
      coneflat batch "scans/**/*.ply" --out flat --format glb --distortion 0.1 --summary flat.csv
      coneflat batch models --out flat --dask tcp://10.0.0.1:8786
    """
    from ...io import make_folder
    from ...measure import REPORTED, parse_requirements
    from ..batch import find_jobs, run_batch
    from .run import Console

    check_combinations(context)
    flags = chosen(given, BatchFlags)
    if flags.jobs is not None and flags.dask is not None:
        raise click.UsageError("the cluster has its own processes: leave out --jobs", context)
    options = keywords(given)
    _refuse_vertices(context, options)
    parse_requirements(required, REPORTED)
    read_options(options)  # Says what makes no sense before the work.
    todo = find_jobs(patterns, flags.out.absolute(), f".{flags.format}", options, weld, required)
    make_folder(flags.out)
    rows = []
    with Console(verbosity) as console:

        def tell(row: dict[str, Any], done: int, count: int) -> None:
            rows.append(row)
            what, *more = _lines(row, console.verbose)
            console.say(
                [f"{done:>{len(str(count))}}/{count}  {printable(Path(row['mesh']).name)}  {what}", *more]
            )
            console.progress(f"{done} of {plural(count, 'mesh', 'meshes')}", done / count)

        console.say([f"flattening {plural(len(todo), 'mesh', 'meshes')} into {flags.out}"])
        console.progress("flatten", 0.0)
        found = run_batch(
            todo,
            flags.out.absolute(),
            processes=flags.jobs,
            limit=flags.time_limit,
            dask=flags.dask,
            redo=flags.redo,
            summary=flags.summary,
            listener=tell,
        )
        before = f", {found.skipped:,} of them before" if found.skipped else ""
        failed = f"; {found.failed:,} failed" if found.failed else ""
        console.say(f"note: {note}" for note in found.notes)
        console.say([f"{len(todo) - found.failed:,} of {len(todo):,} meshes are flattened{before}{failed}"])
        console.say(_slowest(rows, console.elapsed))
        console.finish([flags.summary or flags.out / "summary.csv"])
    if found.failed:
        sys.exit(1)


def _lines(row: dict[str, Any], verbose: bool) -> Iterator[str]:
    """Yield what became of a mesh; if verbose, also where the result is, and the notes on it."""
    if row["status"] != "done":
        yield f"failed: {printable(row['error'])}"
        return
    counts = f"{plural(row['triangles'], 'triangle')}, {plural(row['cones'], 'cone')}"
    yield f"{counts}, QC {row['qc_mean']:.4f}, {row['seconds']:.1f} s"
    if verbose:
        yield f"wrote {printable(row['output'])}"
        yield from [f"note: {row['notes']}"] * bool(row["notes"])


def _slowest(rows: Sequence[dict[str, Any]], elapsed: float) -> Iterator[str]:
    """Yield where the time went, if anything was done."""
    took = sorted(((row["seconds"] or 0.0, printable(Path(row["mesh"]).name)) for row in rows), reverse=True)
    if took:
        longest = ", ".join(f"{name} {seconds:.1f}" for seconds, name in took[:3])
        yield f"time {elapsed:.1f} s, {sum(seconds for seconds, _ in took):.1f} s of work; the longest: {longest}"


def _refuse_vertices(context: click.Context, options: dict[str, Any]) -> None:
    """Refuse what names the vertices of one mesh."""
    for name, what in (
        ("cones", "vertices that are cones fit one mesh"),
        ("boundary", "corners fit one mesh"),
        ("seams", "a file of seams fits one mesh: say input"),
        ("weights", "a file of weights fits one mesh: name a property, or color"),
        ("seam_weights", "a file of weights fits one mesh: name a property"),
    ):
        if not isinstance(options.get(name, ""), str):
            raise click.UsageError(f"{what}, in {flag_of(name)}", context)
