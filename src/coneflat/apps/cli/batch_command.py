"""`coneflat batch`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ...base import plural, printable
from ...options import Options, declarations, read_options
from ...textures import MAX_ENERGY, TextureOptions, UnwrapOptions
from .checks import check_combinations
from .flags import flag, flag_name, keywords, option_flags, path_flag, pop_flags
from .grouped_help import GroupedCommand
from .shared_flags import FORMAT_CHOICE, input_options, paper_option, require_option, verbosity_options

if TYPE_CHECKING:
    from ..batch import BatchSummary
    from .run import Console


@dataclass(frozen=True, kw_only=True)
class BatchFlags:
    """Output.

    Attributes:
        out: Folder for the results, the journal and the summary; created if it does not exist.
        format: File format of the results.
        uv_set: As of `coneflat unwrap`.
        summary: File for the summary table, .csv.  [default: summary.csv in --out]
        jobs: Number of processes on this machine.  [default: the number of cores]
        time_limit: Time in seconds after which a mesh fails; --search-time ends its search with a result.
        dask: Address of a Dask scheduler whose cluster is used, for example tcp://host:8786.
        redo: Also flatten meshes that are done.
    """

    out: Path = path_flag(required=True)
    format: str = flag("obj", type=FORMAT_CHOICE)
    uv_set: int | None = flag(type=click.IntRange(0, 1))
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
@option_flags(TextureOptions)
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
    **params: Any,
) -> None:
    """Flatten all meshes that match the patterns: files, folders, or names with *, ? and ** in quotes.

    With an option for textures they are unwrapped, as by `coneflat unwrap`.

    A mesh that fails does not stop the others. A further run continues with the meshes that are not done.

    \b
    Examples:
      coneflat batch models --out flat
      coneflat batch "scans/**/*.ply" --out flat --format glb --distortion 0.1 --summary flat.csv
      coneflat batch models --out flat --dask tcp://10.0.0.1:8786
    """
    from ...io import check_uv_set, make_folder
    from ...measures import REPORTED, parse_requirements
    from ..batch import find_jobs, run_batch
    from .run import Console

    check_combinations(context)
    flags = pop_flags(params, BatchFlags)
    if flags.jobs is not None and flags.dask is not None:
        raise click.UsageError("--jobs has no effect with --dask: leave out --jobs", context)
    options = _options(context, params)
    if options.get("search_time") is not None and options["search_time"] >= flags.time_limit:
        raise click.UsageError("--search-time must be below --time-limit, after which a mesh fails", context)
    parse_requirements(required, REPORTED)
    ending = f".{flags.format}"
    check_uv_set(f"a {ending}", ending, flags.uv_set)
    todo = find_jobs(patterns, flags.out.absolute(), ending, options, weld, required, flags.uv_set)
    make_folder(flags.out)
    table = flags.summary or flags.out / "summary.csv"
    rows: list[dict[str, Any]] = []
    with Console(verbosity) as console:
        console.say([f"flattening {plural(len(todo), 'mesh', 'meshes')} into {printable(flags.out)}"])
        console.progress("flatten", 0.0)
        try:
            outcome = run_batch(
                todo,
                flags.out.absolute(),
                processes=flags.jobs,
                limit=flags.time_limit,
                dask=flags.dask,
                redo=flags.redo,
                summary=flags.summary,
                listener=_listener(console, rows),
                progress=console.progress,
            )
        except KeyboardInterrupt as error:
            again = "with --redo, all are flattened again" if flags.redo else "it continues with the others"
            raise KeyboardInterrupt(
                f"interrupted after {plural(len(rows), 'mesh', 'meshes')}: if the same command is run again, {again}"
            ) from error
        console.say(_outcome_lines(outcome, len(todo)))
        console.say(_slowest(rows, console.elapsed))
        console.finish([table])
    if outcome.failed:
        sys.exit(
            f"coneflat: error: {outcome.failed:,} of {len(todo):,} meshes failed, see {printable(table)}"
        )


def _listener(console: Console, rows: list[dict[str, Any]]) -> Callable[[dict[str, Any], int, int], None]:
    """Return a function that prints the row of each mesh when it is done, and appends it to rows."""

    def report(row: dict[str, Any], done: int, count: int) -> None:
        rows.append(row)
        first, *details = _lines(row, console.verbose)
        console.say(
            [f"{done:>{len(str(count))}}/{count}  {printable(Path(row['mesh']).name)}  {first}", *details]
        )
        console.progress(f"{done} of {plural(count, 'mesh', 'meshes')}", done / count)

    return report


def _options(context: click.Context, params: dict[str, Any]) -> dict[str, Any]:
    """Return the options of each mesh, checked; with options for textures, those of `coneflat.unwrap`."""
    textures = {name: params[name] for name in declarations(TextureOptions) if params[name] is not None}
    options = keywords(params) | ({"max_energy": MAX_ENERGY, **textures} if textures else {})
    _refuse_vertices(context, options)
    read_options(options, UnwrapOptions if textures else Options)
    return options


def _outcome_lines(outcome: BatchSummary, count: int) -> Iterator[str]:
    """Yield the notes on a batch of meshes, and how many of them are flattened."""
    yield from (f"note: {note}" for note in outcome.notes)
    before = f", {outcome.skipped:,} of them before" if outcome.skipped else ""
    failed = f"; {outcome.failed:,} failed" if outcome.failed else ""
    yield f"{count - outcome.failed:,} of {count:,} meshes are flattened{before}{failed}"


def _lines(row: dict[str, Any], verbose: bool) -> Iterator[str]:
    """Yield the lines on a mesh: its measures or error; if verbose, also the path of the result and the notes."""
    if row["status"] != "done":
        yield f"failed: {printable(row['error'])}"
        return
    counts = f"{plural(row['triangles'], 'triangle')}, {plural(row['cones'], 'cone')}"
    yield f"{counts}, QC {row['qc_mean']:.4f}, {row['seconds']:.1f} s"
    if verbose:
        yield f"wrote {printable(row['output'])}"
        yield from [f"note: {row['notes']}"] * bool(row["notes"])


def _slowest(rows: Sequence[dict[str, Any]], elapsed: float) -> Iterator[str]:
    """Yield a line with the time of the batch and of the slowest meshes, if any was flattened."""
    took = sorted(((row["seconds"] or 0.0, printable(Path(row["mesh"]).name)) for row in rows), reverse=True)
    if took:
        longest = ", ".join(f"{name} {seconds:.1f}" for seconds, name in took[:3])
        yield f"time {elapsed:.1f} s, {sum(seconds for seconds, _ in took):.1f} s of work; the longest: {longest}"


def _refuse_vertices(context: click.Context, options: dict[str, Any]) -> None:
    """Raise an error if an option refers to the vertices of one mesh."""
    for name, reason in (
        ("cones", "a list of vertices applies to one mesh only"),
        ("boundary", "a list of corners applies to one mesh only"),
        ("seams", "a file of seams applies to one mesh only: write input"),
        ("weights", "a file of weights applies to one mesh only: give the name of a property, or color"),
        ("seam_weights", "a file of weights applies to one mesh only: give the name of a property"),
    ):
        if not isinstance(options.get(name, ""), str):
            raise click.UsageError(f"{flag_name(name)}: {reason}", context)
