"""`coneflat pattern`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..patterns import PatternOptions
from .flags import (
    GroupedCommand,
    check_required,
    flag,
    input_options,
    keywords,
    names_formats,
    option_flags,
    path_flag,
    pop_flags,
    require_option,
    verbosity_options,
)

if TYPE_CHECKING:
    from ... import Pattern


@dataclass(frozen=True, kw_only=True)
class PatternFlags:
    """Output.

    Attributes:
        output: File to write: pages (.pdf), or the whole sheet (.svg, .dxf); repeat for several.  [default: MESH's
            name with .pdf]
        report: JSON file for all measures.
    """

    output: tuple[Path, ...] = flag((), type=click.Path(path_type=Path), multiple=True)
    report: Path | None = path_flag()


@click.command(cls=GroupedCommand, short_help="Make a sewing pattern, a papercraft net, or a sheet blank.")
@click.argument("mesh", type=click.Path(path_type=Path))
@option_flags(PatternOptions)
@option_flags(PatternFlags)
@input_options
@require_option
@verbosity_options
@names_formats
def pattern(
    mesh: Path, weld: bool | None, required: tuple[str, ...], verbosity: str | None, **params: Any
) -> None:
    """Make a pattern of MESH at its true size: pieces of cloth, paper or sheet.

    MESH is a file ({MESH}).

    \b
    Examples:
      coneflat pattern toy.stl --height 300mm -o toy.pdf
      coneflat pattern toy.stl --height 12in --strain 5% --page letter
      coneflat pattern house.obj --kind net --unit m --scale 0.01 -o house.pdf -o house.svg
      coneflat pattern globe.ply --kind gores --gores 12 --height 200mm --page roll:900mm
      coneflat pattern bracket.stl --kind sheet --unit mm -o bracket.dxf
      coneflat pattern toy.stl --height 300mm --require "strain_max<=0.03"
    """
    from ... import pattern as make_pattern
    from ...io import check_target, read_joined
    from ...measures import parse_requirements
    from ...options import read_options
    from ..patterns import PATTERN_MEASURES, check_pattern_output
    from .run import Console, require_distinct, write_report

    flags, options = pop_flags(params, PatternFlags), keywords(params, PatternOptions)
    read_options(options, PatternOptions)
    outputs = flags.output or (Path(f"{mesh.stem}.pdf"),)
    for path in outputs:
        check_pattern_output(path)
    if flags.report is not None:
        check_target(flags.report)
    require_distinct({"input": mesh, "report": flags.report, **{str(path): path for path in outputs}})
    requirements = parse_requirements(required, PATTERN_MEASURES)
    with Console(verbosity) as console:
        with console.stage("read", 0.0):
            joined = read_joined(mesh, weld)
        with console.stage("pattern", console.READ):
            result = make_pattern(joined.mesh, progress=console.part(), **joined.map_options(options))
        with console.stage("write"):
            for path in outputs:
                result.save(path)
        report = result.report()
        if flags.report is not None:
            write_report(flags.report, {**report, "seconds": dict(console.seconds)})
        console.notes(joined.all_notes(result.notes))
        console.finish([*outputs, *([] if flags.report is None else [flags.report])])
        console.table(_rows(result, report))
    check_required(requirements, report, str(outputs[0]))


def _rows(result: Pattern, report: dict[str, Any]) -> list[tuple[str, str, str]]:
    """Return the rows of the table of measures."""
    eased = f"sides of {report['eased_seams']} differ, by {report['ease_max']:.1f} mm at most"
    rows = [
        ("pieces", f"{report['pieces']}", f"{report['area'] / 100:.0f} cm\u00b2 in total"),
        (
            "seams",
            f"{report['seams'] - report['darts']}",
            eased if report["eased_seams"] else "sides equally long",
        ),
        ("darts", f"{report['darts']}", "ends of seams inside a piece"),
        ("seam length", f"{report['seam_length']:.0f} mm", "on the model, darts included"),
        ("strain", f"{100 * report['strain_max']:.2g} %", "largest relative change of the length of an edge"),
        (
            "sheet",
            f"{report['sheet_width']:.0f} x {report['sheet_height']:.0f} mm",
            f"{100 * report['sheet_share']:.0f} % of it covered by pieces",
        ),
        ("pages", f"{report['pages']}", f"{result.settings.get('page', 'A4')}, without the assembly guide"),
    ]
    return rows if result.is_sewn else [row for row in rows if row[0] != "darts"]
