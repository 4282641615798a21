"""Data of files in addition to positions, faces, UVs and normals: what readers find, what writers keep, and the note.

Every reader lists the attributes that it finds in `MeshFile.attributes`; every writer names those that it keeps. The
difference is the note on a written file.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..base.arrays import FloatArray
from ..base.text import printable

if TYPE_CHECKING:
    from .mesh_file import MeshFile

# Characters of a name that a note shows, and names of a kind.
MAX_NAME, MAX_NAMES = 40, 20
# Largest value of a colour in bytes, and the value of sRGB up to which its curve is a line.
BYTE, LINEAR_BELOW = 255, 0.04045


#: The kind of attributes that are names of images.
TEXTURE_FILES = "texture files"


class Attribute(NamedTuple):
    """Data of one kind in a file.

    Attributes:
        kind: a plural noun, such as "vertex properties".
        name: the name in the file; "" for kinds of which a note shows no names.
    """

    kind: str
    name: str = ""


VERTEX_COLOURS = Attribute("vertex colours")
ALPHA = Attribute("vertex properties", "alpha")
GROUPS, OBJECTS, MATERIALS = Attribute("groups"), Attribute("objects"), Attribute("materials")


def losses(
    source: MeshFile | None, ending: str, kept: Collection[Attribute], other: str = ""
) -> tuple[str, ...]:
    """Return a note on the attributes of a source file that a written file does not keep, if there are any.

    Args:
        source: the file that the mesh was read from, if any.
        ending: the ending of the written file.
        kept: the attributes that are kept.
        other: ending of a format that keeps all of them, if there is one.
    """
    lost = [] if source is None else [each for each in source.attributes if each not in kept]
    if not lost:
        return ()
    advice = f"; {other} keeps them" if other else ""
    return (f"These data of the input are not kept in {ending}: {list_attributes(lost)}{advice}.",)


def texture_files(source: MeshFile) -> list[Attribute]:
    """Return the names of images among the attributes of a file."""
    return [each for each in source.attributes if each.kind == TEXTURE_FILES]


def list_attributes(attributes: Iterable[Attribute]) -> str:
    """Return attributes as text: "groups, vertex properties (quality, label)"."""
    names: dict[str, list[str]] = {}
    for kind, name in attributes:
        names.setdefault(kind, []).extend([name] if name else [])
    return ", ".join(f"{kind} ({list_names(each)})" if each else kind for kind, each in names.items())


def list_names(names: Sequence[str]) -> str:
    """Return names as text, with the number of those that are not shown."""
    more = len(names) - MAX_NAMES
    shown = ", ".join(printable(name)[:MAX_NAME] for name in names[:MAX_NAMES])
    return f"{shown} and {more:,} more" if more > 0 else shown


def colour_shades(values: FloatArray) -> FloatArray:
    """Return the parts of colours as 0 to 1: numbers above 1 mean that they are bytes."""
    numbers = np.asarray(values, np.float64)
    return numbers / BYTE if np.nanmax(numbers, initial=0.0) > 1 else numbers


def to_linear(shades: FloatArray) -> FloatArray:
    """Return the linear values of parts of colours in sRGB, both from 0 to 1."""
    curve = ((shades + 0.055) / 1.055) ** 2.4
    return np.where(shades <= LINEAR_BELOW, shades / 12.92, curve)


def as_bytes(shades: FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    """Return numbers from 0 to 1 as bytes; NaN becomes 0."""
    return np.round(BYTE * np.clip(np.nan_to_num(shades), 0, 1)).astype(np.uint8)
