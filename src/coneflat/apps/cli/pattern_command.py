"""`coneflat pattern`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from ..patterns import PatternOptions
from .checks import check_required
from .flags import flag, keywords, option_flags, path_flag, pop_flags
from .grouped_help import GroupedCommand, names_formats
from .shared_flags import input_options, require_option, verbosity_options


@dataclass(frozen=True, kw_only=True)
class PatternFlags:
    """Output.

    Attributes:
        output: File to write: pages (.pdf), or the whole sheet (.svg, .dxf); repeat for several.  [default: MESH's
            name with .pdf; none if --view is given]
        view: Page (.html) that shows the model and its pieces with numbers, the partner of each seam, darts and strain.
        report: JSON file for all measures.
    """

    output: tuple[Path, ...] = flag((), type=click.Path(path_type=Path), multiple=True)
    view: Path | None = path_flag()
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
      coneflat pattern toy.stl --height 300mm --view toy.html
    """
    from ... import pattern as make_pattern
    from ...io import PIPE, check_target, read_joined
    from ...measures import parse_requirements
    from ...options import read_options
    from ..patterns import PATTERN_MEASURES, check_pattern_output, page_of_pattern, rows_of
    from ..view import check_page, write_page
    from .run import Console, require_distinct, write_report

    flags, options = pop_flags(params, PatternFlags), keywords(params, PatternOptions)
    read_options(options, PatternOptions)
    name = "pattern" if mesh == PIPE else mesh.stem
    outputs = flags.output or (() if flags.view else (Path(f"{name}.pdf"),))
    for path in outputs:
        check_pattern_output(path)
    if flags.view is not None:
        check_page(flags.view)
    if flags.report is not None:
        check_target(flags.report)
    files = {"input": mesh, "view": flags.view, "report": flags.report}
    require_distinct({**files, **{f"output {i + 1}": path for i, path in enumerate(outputs)}})
    requirements = parse_requirements(required, PATTERN_MEASURES)
    with Console(verbosity) as console:
        with console.stage("read", 0.0):
            joined = read_joined(mesh, weld)
        with console.stage("pattern", console.READ):
            result = make_pattern(joined.mesh, progress=console.part(), **joined.map_options(options))
        with console.stage("write"):
            for path in outputs:
                result.save(path)
            if flags.view is not None:
                write_page(page_of_pattern(result, name=mesh.name), flags.view)
        report = result.report()
        if flags.report is not None:
            write_report(flags.report, {**report, "seconds": dict(console.seconds)})
        console.notes(joined.all_notes(tuple(report["notes"])))
        written = [*outputs, *(path for path in (flags.view, flags.report) if path is not None)]
        console.finish(written)
        console.table(rows_of(result, report))
    check_required(requirements, report, str(written[0]))
