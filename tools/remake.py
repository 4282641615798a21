"""Regenerate the generated parts of the documentation: `python tools/remake.py`.

Its parts are the tables of options, the drawing of the structure, the list of messages, the numbers and the pictures;
`--only options,structure` selects some of them. `--check` changes nothing, and fails if a part is out of date.
Times depend on the machine, and are measured by `benchmarks/`.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

from markers import PAGES, ROOT, fill

DOCS = ROOT / "docs"
MODELS = ROOT.parent / "shared" / "meshes"


def remake_options(_: argparse.Namespace | None = None) -> Iterator[tuple[Path, str]]:
    """Yield the pages with tables of options and the list of measures."""
    from measure_list import measure_list
    from option_table import (
        flag_tables,
        keyword_tables,
        pattern_flag_table,
        pattern_keyword_table,
        quad_flag_table,
        quad_keyword_table,
    )

    tables = {
        "reference/command-line.md": {
            "options": flag_tables,
            "quad options": quad_flag_table,
            "pattern options": pattern_flag_table,
            "measures": measure_list,
        },
        "reference/python.md": {
            "keywords": keyword_tables,
            "quad keywords": quad_keyword_table,
            "pattern keywords": pattern_keyword_table,
        },
    }
    for page, by_name in tables.items():
        text = (DOCS / page).read_text(encoding="utf-8")
        for name, table in by_name.items():
            text = fill(text, name, table())
        yield DOCS / page, text


def remake_structure(_: argparse.Namespace) -> Iterator[tuple[Path, str]]:
    """Yield the drawing of the structure."""
    from structure import draw_structure

    yield DOCS / "images" / "structure.svg", draw_structure()


def remake_messages(_: argparse.Namespace) -> Iterator[tuple[Path, str]]:
    """Yield the list of the texts that users see."""
    from messages import list_messages

    yield ROOT / "tools" / "messages.txt", list_messages()


def remake_numbers(arguments: argparse.Namespace) -> Iterator[tuple[Path, str]]:
    """Yield the pages with their numbers."""
    from measured import Measured
    from tables import fill_page

    measured = arguments.measured = Measured(arguments.models)
    for page in PAGES:
        fill_page(
            page.read_text(encoding="utf-8"), measured
        )  # This takes long, and the page may be edited meanwhile.
        yield page, fill_page(page.read_text(encoding="utf-8"), measured)


def remake_pictures(arguments: argparse.Namespace) -> Iterator[tuple[Path, str]]:
    """Draw the pictures; no text changes."""
    from measured import Measured
    from pictures import draw_pictures

    measured = getattr(arguments, "measured", None) or Measured(arguments.models)
    draw_pictures(measured, arguments.pictures or ["*"])
    yield from ()


PARTS: dict[str, Callable[[argparse.Namespace], Iterator[tuple[Path, str]]]] = {
    "options": remake_options,
    "structure": remake_structure,
    "messages": remake_messages,
    "numbers": remake_numbers,
    "pictures": remake_pictures,
}


def main() -> int:
    """Regenerate the selected parts, and return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--only", help=f"parts, with commas between, of {', '.join(PARTS)}")
    parser.add_argument(
        "--pictures", nargs="*", help="names of pictures as in docs/images, gallery-* say; all"
    )
    parser.add_argument("--models", type=Path, default=MODELS, help="the folder of models (%(default)s)")
    parser.add_argument(
        "--check", action="store_true", help="change nothing, and fail where something differs"
    )
    arguments = parser.parse_args()
    parts = arguments.only.split(",") if arguments.only else list(PARTS)
    unknown = [part for part in parts if part not in PARTS]
    if unknown:
        parser.error(f"no part {unknown[0]!r}: choose from {', '.join(PARTS)}")
    from coneflat import GuaranteeWarning

    warnings.simplefilter("ignore", GuaranteeWarning)  # The tables say what methods do not meet.
    differs = False
    for part in parts:
        if part == "pictures" and arguments.check:
            continue
        for page, text in PARTS[part](arguments):
            if page.exists() and text == page.read_text(encoding="utf-8"):
                continue
            differs = True
            print(f"{page.relative_to(ROOT)}: {part} {'differ' if arguments.check else 'remade'}", flush=True)
            if not arguments.check:
                page.write_text(text, encoding="utf-8")
    return int(differs and arguments.check)


if __name__ == "__main__":
    sys.exit(main())
