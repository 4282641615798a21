"""`coneflat brain`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from ...base import Use, endings, plural
from ...options import ConeNumber, Direction, RunOptions, option, strength
from .flags import flag, keywords, option_flags, path_flag, pop_flags
from .grouped_help import GroupedCommand
from .measure_command import rows_of_measures
from .shared_flags import verbosity_options


@dataclass(frozen=True, kw_only=True)
class BrainOptions(ConeNumber, RunOptions):
    """Cones.

    Attributes:
        stretch: Trade-off between angles (0) and distances (1).
        up: Direction of the surface that points up in the flat map, superior by default.
    """

    stretch: float = option(1.0, strength(1.0))
    up: tuple[float, float, float] | None = option(None, Direction())


@dataclass(frozen=True, kw_only=True)
class BrainFlags:
    """Output.

    Attributes:
        output: File to write: a GIFTI surface (.gii), a FreeSurfer patch (.3d), or a result ({FLATTENING}), which
            view and figure show; repeat for several.  [default: SURFACE's name with .flat.gii]
        remove_label: Label to cut off, such as the medial wall: FILE.label, or FILE:NAME for an .annot or a label .gii;
            repeat for several.
        keep_label: Label that no cut crosses.
        report: JSON file for all measures.
    """

    output: tuple[Path, ...] = flag((), type=click.Path(path_type=Path), multiple=True)
    remove_label: tuple[str, ...] = flag((), multiple=True, metavar="LABEL")
    keep_label: tuple[str, ...] = flag((), multiple=True, metavar="LABEL")
    report: Path | None = path_flag()


@click.command(cls=GroupedCommand, short_help="Make a flat map of a brain's cortex.")
@click.argument("surface", type=click.Path(path_type=Path))
@option_flags(BrainFlags)
@option_flags(BrainOptions)
@verbosity_options
@click.pass_context
def brain(context: click.Context, /, surface: Path, verbosity: str | None, **params: Any) -> None:
    """Make a flat map of SURFACE, the cortex of one hemisphere (.gii, or FreeSurfer's lh.pial).

    \b
    Examples:
      coneflat brain lh.pial --remove-label lh.aparc.annot:unknown -o lh.flat.gii
      coneflat brain lh.white --remove-label lh.Medial_wall.label -o lh.flat.patch.3d -o lh.npz
      coneflat figure lh.npz --color lh.sulc
      coneflat measure lh.flat.gii --surface lh.white
    """
    from ...io import as_written, check_target, checked_target, losses
    from ..brains import FLAT_FORMATS, flatten_cortex, kept_in_flat, measure_flat
    from .run import Console, require_distinct, write_report

    flags, options = pop_flags(params, BrainFlags), keywords({**params, "repair": True}, BrainOptions)
    outputs = flags.output or (Path(f"{surface.name}.flat.gii"),)
    formats = (*FLAT_FORMATS, *endings(Use.FLATTENING))
    for path in outputs:
        checked_target(path, formats, "flat maps are written as")
    if flags.report is not None:
        check_target(flags.report)
    require_distinct({"surface": surface, "report": flags.report, **{str(path): path for path in outputs}})
    with Console(verbosity) as console:
        cortex = flatten_cortex(
            surface, remove=flags.remove_label, keep=flags.keep_label, progress=console.part(), **options
        )
        console.seconds.update(cortex.result.seconds)
        with console.stage("write"):
            for path in outputs:
                (cortex if path.suffix.lower() in FLAT_FORMATS else cortex.result).save(path)
        # The file for FreeSurfer leaves out the most triangles.
        smallest = next((path for path in outputs if path.suffix.lower() == ".3d"), Path(".gii"))
        with console.stage("measure"):
            measured = measure_flat(cortex.uv_mesh(smallest))
        if flags.report is not None:
            write_report(flags.report, {**measured.report(), "seconds": dict(console.seconds)})
        left_out = len(cortex.result.faces) - int(measured.uv.counts["triangles"])
        along = [f"{plural(left_out, 'triangle')} along cuts left out of the flat map."] if left_out else []
        notes = [*cortex.result.notes, *measured.uv.notes, *along]
        for ending in dict.fromkeys(path.suffix.lower() for path in outputs):
            if ending in FLAT_FORMATS:
                notes += losses(cortex.surface, ending, kept_in_flat(cortex.surface, ending))
            else:
                notes += as_written(cortex.result, ending).notes
        console.notes(dict.fromkeys(notes))
        console.finish([*outputs, *([] if flags.report is None else [flags.report])])
        console.table(rows_of_measures(measured.uv, measured))
