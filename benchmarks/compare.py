"""Compare flattening methods on meshes, with the same cones and the same cut.

    python benchmarks/compare.py bunny.obj
    python benchmarks/compare.py horse.ply -o horse --up z --methods exact,linear,bff --options max_cones=20

The methods are those of the package, and baselines: boundary first flattening (BFF) and least squares conformal maps
(LSCM) as implemented in `comparisons`; `--methods` can also name circle patterns and angle based flattening.
`coneflat.unwrap`, xatlas and uvunwrap, where they are installed, find their own cut. A table is printed; with `-o`, it
is written as Markdown and CSV, with pictures of the layouts and of the distortion.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from common import parse_options
from comparisons import COMPARED_METHODS, METHODS, Comparison, compare_methods
from comparisons.pictures import DPI, draw_layouts, draw_qualities, open_folder, write_folder
from comparisons.tables import comparison_csv, comparison_lines, comparison_markdown

from coneflat import PAPER, ConeflatError, read_mesh
from coneflat.apps.view import Look
from coneflat.errors import MetricError

#: Files that are written to the output folder.
FILES = ("compare.md", "compare.csv", "layouts.png", "quality.png")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("meshes", nargs="+", type=Path, metavar="MESH")
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        help="folder for tables and pictures, with one for each of several meshes",
    )
    parser.add_argument(
        "--methods", default=",".join(COMPARED_METHODS), help=f"with commas, of {', '.join(METHODS)}"
    )
    parser.add_argument("--no-atlases", action="store_true", help="only methods with the same cut")
    parser.add_argument("--paper", action="store_true", help="the cones of the published method")
    parser.add_argument(
        "--options", nargs="*", default=[], metavar="NAME=VALUE", help="options of coneflat.flatten"
    )
    parser.add_argument("--eye", default="front-right", help="direction from which pictures show the model")
    parser.add_argument("--up", default="y", help="upward direction of the model")
    arguments = parser.parse_args()
    try:
        look = Look(eyes=(arguments.eye,), up=arguments.up, dpi=DPI)
        for mesh in arguments.meshes:
            print_comparison(mesh, look, arguments)
    except ConeflatError as error:
        parser.exit(2, f"compare.py: error: {error}\n")


def print_comparison(mesh: Path, look: Look, arguments: argparse.Namespace) -> None:
    """Compare the methods on a mesh, print the table, and write it with pictures if there is an output folder.

    Raises:
        ConeflatError: the mesh cannot be flattened, an option is invalid, or a file cannot be written.
    """
    folder = arguments.output
    if folder is not None and len(arguments.meshes) > 1:
        folder /= mesh.stem
    if folder is not None:
        open_folder(folder, FILES)
    comparison = compare_methods(
        read_mesh(mesh),
        methods=[name.strip() for name in arguments.methods.split(",")],
        atlases=() if arguments.no_atlases else None,
        progress=lambda step, fraction: print(f"{fraction:4.0%} {mesh.name}: {step:30}", end="\r"),
        **{**(PAPER if arguments.paper else {}), **parse_options(arguments.options)},
    )
    if not comparison.drawn:
        reasons = "; ".join(f"{entry.method}: {entry.note}" for entry in comparison.entries)
        raise MetricError(f"no method found a layout: {reasons}")
    print("\n".join([f"{mesh.name:40}", *comparison_lines(comparison)]))
    if folder is not None:
        write_folder(folder, contents(comparison, look))


def contents(comparison: Comparison, look: Look) -> dict[str, object]:
    """Return the texts and figures by file name."""
    texts = comparison_markdown(comparison), comparison_csv(comparison)
    figures = draw_layouts(comparison), draw_qualities(comparison, look)
    return dict(zip(FILES, (*texts, *figures), strict=True))


if __name__ == "__main__":
    main()
