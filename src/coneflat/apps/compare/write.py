"""Comparisons as folders of tables and pictures."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from ...files.atomic import atomic_write, check_target, make_folder
from ...view import new_figure, save_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def open_folder(folder: Path, names: Iterable[str]) -> None:
    """Make a folder if it is missing, for files of some names; worth doing before long work.

    Raises:
        OptionError: matplotlib, which draws the pictures, is not installed.
        MeshFileError: the folder cannot be made, or a file not be written there.
    """
    new_figure(1, 1)
    make_folder(folder)
    for name in names:
        check_target(folder / name)


def write_folder(folder: Path, contents: Mapping[str, str | Figure]) -> list[Path]:
    """Write texts and figures by their names, and return the paths."""
    for name, content in contents.items():
        if isinstance(content, str):
            with atomic_write(folder / name, "w") as file:
                file.write(content)
        else:
            save_figure(content, folder / name)
    return [folder / name for name in contents]
