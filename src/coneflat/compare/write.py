"""Comparisons as folders of tables and pictures."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import MeshFileError
from ..io import atomic_write
from ..view import new_figure, save_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def check_folder(folder: Path) -> None:
    """Raise an error if files cannot be written to a folder, or pictures not drawn; worth asking before long work."""
    new_figure(1, 1)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise MeshFileError(f"cannot make the folder {folder}: {error.strerror or error}") from error


def write_folder(folder: Path, texts: Mapping[str, str], figures: Mapping[str, Figure]) -> list[Path]:
    """Write texts and figures by their names, and return the paths."""
    for name, text in texts.items():
        with atomic_write(folder / name, "w") as file:
            file.write(text)
    for name, figure in figures.items():
        save_figure(figure, folder / name)
    return [folder / name for name in (*texts, *figures)]
