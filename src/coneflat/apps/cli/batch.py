"""`coneflat batch`."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import click

from ...options import Options, read_options
from ...options.outputs import FORMATS
from ...text import plural, printable
from .options import check_combinations, flag_of, keywords, option_flags, paper_option
from .shared import checking, input_options, measures_alone, require_option, verbosity_options

FAILED = 1
LONGEST = 3  # meshes that are named


@click.command(short_help="Flatten many meshes, on this machine or on a Dask cluster.")
@click.argument("patterns", metavar="PATTERN...", nargs=-1, required=True)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    required=True,
    help="Folder for the results, the journal and the summary; it is made if need be.",
)
@click.option(
    "--format",
    "ending",
    type=click.Choice(FORMATS),
    default="obj",
    show_default=True,
    help="What to write.",
)
@click.option(
    "--summary", type=click.Path(path_type=Path), help="A .csv or .parquet.  [default: summary.csv in --out]"
)
@click.option("--jobs", type=int, help="Processes on this machine.  [default: as many as there are cores]")
@click.option(
    "--time-limit",
    type=float,
    default=3600.0,
    show_default=True,
    help="Seconds per mesh, after which it has failed.",
)
@click.option(
    "--dask", metavar="ADDRESS", help="Work on the cluster of this Dask scheduler, tcp://host:8786 say."
)
@click.option("--redo", is_flag=True, help="Flatten again what is done.")
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
    out: Path,
    ending: str,
    summary: Path | None,
    jobs: int | None,
    time_limit: float,
    dask: str | None,
    redo: bool,
    repair: bool,
    weld: bool | None,
    required: tuple[str, ...],
    verbosity: str | None,
    **method: Any,
) -> None:
    """Flatten all meshes that the patterns name: files, folders, or *, ? and ** in quotes.

    A mesh that fails does not stop the rest; a further run goes on with what is not done.

    \b
    Examples:
      coneflat batch models --out flat
      coneflat batch "scans/**/*.ply" --out flat --format glb --distortion 0.1 --summary flat.parquet
      coneflat batch models --out flat --dask tcp://10.0.0.1:8786
    """
    from ...files.atomic import make_folder
    from ...result.requirements import REPORTED, parse_requirements
    from ..batch import find_jobs, run_batch
    from .console import Console

    check_combinations(context)
    if jobs is not None and dask is not None:
        raise click.UsageError("the cluster has its own processes: leave out --jobs", context)
    options = {**keywords(method), **checking(repair)}
    _refuse_vertices(context, options)
    parse_requirements(measures_alone(required), REPORTED)
    read_options(options)  # Says what makes no sense before the work.
    todo = find_jobs(patterns, out.absolute(), f".{ending}", options, weld, required)
    make_folder(out)
    rows = []
    with Console(verbosity) as console:

        def tell(row: dict[str, Any], done: int, count: int) -> None:
            rows.append(row)
            what, *more = _lines(row, console.verbose)
            console.say(
                [f"{done:>{len(str(count))}}/{count}  {printable(Path(row['mesh']).name)}  {what}", *more]
            )
            console.progress(f"{done} of {plural(count, 'mesh', 'meshes')}", done / count)

        console.say([f"flattening {plural(len(todo), 'mesh', 'meshes')} into {out}"])
        console.progress("flatten", 0.0)
        found = run_batch(
            todo,
            out.absolute(),
            processes=jobs,
            limit=time_limit,
            dask=dask,
            redo=redo,
            summary=summary,
            listener=tell,
        )
        before = f", {found.skipped:,} of them before" if found.skipped else ""
        failed = f"; {found.failed:,} failed" if found.failed else ""
        console.say(f"note: {note}" for note in found.notes)
        console.say([f"{len(todo) - found.failed:,} of {len(todo):,} meshes are flattened{before}{failed}"])
        console.say(_slowest(rows, console.elapsed))
        console.finish([summary or out / "summary.csv"])
    if found.failed:
        sys.exit(FAILED)


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
        longest = ", ".join(f"{name} {seconds:.1f}" for seconds, name in took[:LONGEST])
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
