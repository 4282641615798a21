"""Data of files in addition to positions, faces, UVs and normals: what readers find, what writers keep, and the note.

Every reader lists the attributes that it finds in `MeshFile.attributes`; every writer names those that it keeps. The
difference is the note on a written file.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

from ..base.text import printable

if TYPE_CHECKING:
    from .mesh_file import MeshFile

# Characters of a name that a note shows, and names of a kind.
MAX_NAME, MAX_NAMES = 40, 20
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
    source: MeshFile | None, ending: str, kept_attributes: Collection[Attribute], better_ending: str = ""
) -> tuple[str, ...]:
    """Return a note on the attributes of a source file that a written file does not keep, if there are any.

    Args:
        source: the file that the mesh was read from, if any.
        ending: the ending of the written file.
        kept_attributes: the attributes that are kept.
        better_ending: ending of a format that keeps all of them, if there is one.
    """
    lost_attributes = [] if source is None else [a for a in source.attributes if a not in kept_attributes]
    if not lost_attributes:
        return ()
    advice = f"; {better_ending} keeps them" if better_ending else ""
    return (f"These data of the input are not kept in {ending}: {list_attributes(lost_attributes)}{advice}.",)


def old_textures(owner: str) -> str:
    """Return the note that textures of an owner, such as "2 materials", do not fit the new UVs."""
    return (
        f"The textures of {owner} are kept, but were made for the old UVs; `coneflat transfer` bakes them into the new "
        "ones."
    )


def texture_files(source: MeshFile) -> list[Attribute]:
    """Return the names of images among the attributes of a file."""
    return [attribute for attribute in source.attributes if attribute.kind == TEXTURE_FILES]


def list_attributes(attributes: Iterable[Attribute]) -> str:
    """Return attributes as text: "groups, vertex properties (quality, label)"."""
    names_of: dict[str, list[str]] = {}
    for kind, name in attributes:
        names_of.setdefault(kind, []).extend([name] if name else [])
    return ", ".join(f"{kind} ({list_names(names)})" if names else kind for kind, names in names_of.items())


def list_names(names: Sequence[str]) -> str:
    """Return names as text, with the number of those that are not shown."""
    text = ", ".join(printable(name)[:MAX_NAME] for name in names[:MAX_NAMES])
    return f"{text} and {len(names) - MAX_NAMES:,} more" if len(names) > MAX_NAMES else text
