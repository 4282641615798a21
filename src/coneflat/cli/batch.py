"""`coneflat batch`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from .method import check_combinations, method_keywords, method_options

FAILED = 1


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
    type=click.Choice(["obj", "ply", "glb", "npz"]),
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
@method_options
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
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
    weld: bool | None,
    quiet: bool,
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
    from ..batch import find_jobs, run_batch
    from ..errors import MeshFileError
    from ..options import Options

    check_combinations(context)
    if jobs is not None and dask is not None:
        raise click.UsageError("the cluster has its own processes: leave out --jobs", context)
    options = method_keywords(method, f".{ending}")
    if options.get("weights") is not None and not isinstance(options["weights"], str):
        raise click.UsageError("a file of --weights fits one mesh: name a property, or color", context)
    Options(**options)  # Says what makes no sense before the work.
    todo = find_jobs(patterns, out.absolute(), f".{ending}", options, weld)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise MeshFileError(f"{out} cannot be made: {error.strerror}") from error
    found = run_batch(
        todo,
        out.absolute(),
        processes=jobs,
        limit=time_limit,
        dask=dask,
        redo=redo,
        summary=summary,
        listener=None if quiet else _tell,
    )
    if not quiet:
        before = f", {found.skipped:,} of them before" if found.skipped else ""
        failed = f"; {found.failed:,} failed" if found.failed else ""
        click.echo(f"{len(todo) - found.failed:,} of {len(todo):,} meshes are flattened{before}{failed}")
        click.echo(f"wrote {summary or out / 'summary.csv'}")
    if found.failed:
        sys.exit(FAILED)


def _tell(row: dict[str, Any], done: int, count: int) -> None:
    """Print a line for a mesh."""
    what = (
        f"{row['triangles']:,} triangles, {row['cones']} cones, QC {row['qc_mean']:.4f}, {row['seconds']:.1f} s"
        if row["status"] == "done"
        else f"failed: {row['error']}"
    )
    click.echo(f"{done:>{len(str(count))}}/{count}  {Path(row['mesh']).name}  {what}")
