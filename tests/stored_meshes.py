"""Stored meshes, see `tests/data/SOURCES.md`: real models, and meshes that once failed."""

from __future__ import annotations

import json
import lzma
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

DATA = Path(__file__).resolve().parent / "data"
REGRESSIONS = DATA / "regressions"
#: Further models, where they are.
SHARED = DATA.parents[2] / "shared" / "meshes"


def find_model(name: str, folder: Path) -> Path:
    """Return the path of a model; those of `tests/data` are decompressed into a folder.

    Raises:
        FileNotFoundError: the model is in neither place.
    """
    compressed = DATA / f"{name}.xz"
    if not compressed.exists():
        if not (SHARED / name).exists():
            raise FileNotFoundError(f"{name} is neither in {DATA} nor in {SHARED}")
        return SHARED / name
    path = folder / name
    if not path.exists():
        path.write_bytes(lzma.decompress(compressed.read_bytes()))
    return path


def at_hand(*names: str) -> list[str]:
    """Return those of the names whose models are in `../shared/meshes`."""
    return [name for name in names if (SHARED / name).exists()]


@cache
def model_folder() -> Path:
    """Return a folder of all models: `../shared/meshes`, or a temporary one with those of `tests/data`."""
    if SHARED.exists():
        return SHARED
    folder = Path(_temporary_folder().name)
    for path in DATA.glob("*.xz"):
        find_model(path.stem, folder)
    return folder


@cache
def _temporary_folder() -> tempfile.TemporaryDirectory[str]:
    """Return a folder that is removed when the process ends."""
    return tempfile.TemporaryDirectory(prefix="coneflat-models-", ignore_cleanup_errors=True)


def regression(name: str) -> tuple[np.ndarray, np.ndarray, dict[str, Any]]:
    """Return the vertices and faces of a mesh that once failed, and the options of the call."""
    with np.load(REGRESSIONS / f"{name}.npz") as file:
        options = json.loads(str(file["options"]), object_pairs_hook=_by_vertex)
        return file["vertices"], file["faces"], options


def _by_vertex(pairs: list[tuple[str, Any]]) -> dict[Any, Any]:
    """Return a dictionary in which keys that are numbers are vertices."""
    return {int(key) if key.isdecimal() else key: value for key, value in pairs}


def noisy(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices and faces of a stored shape with noise."""
    lines = lzma.decompress((REGRESSIONS / f"{name}.obj.xz").read_bytes()).decode().splitlines()
    rows = {kind: [line.split()[1:] for line in lines if line[0] == kind] for kind in "vf"}
    return np.array(rows["v"], dtype=float), np.array(rows["f"], dtype=np.int64) - 1


def stored_heights(seed: str, count: int) -> np.ndarray:
    """Return (count,) normally distributed heights, for sheets of spikes."""
    with np.load(REGRESSIONS / "heights.npz") as file:
        return file[seed][:count]
