"""The table of file formats: what is read from files of each, and what is written to them.

Help texts and checks of endings follow from the table. The functions that read and write are named in `io/read.py`,
`io/write.py` and `quadmesh/files.py`, which are imported late, as they need much more time than a help text.
"""

from __future__ import annotations

from enum import Flag, auto


class Use(Flag):
    """What a file format is used for."""

    #: Meshes are read from it.
    MESH = auto()
    #: UVs are read from it, too.
    UV = auto()
    #: Flattened meshes are written to it.
    FLATTENING = auto()
    #: Quad meshes are written to it.
    QUADS = auto()
    #: The same, by meshio.
    MESHIO = auto()
    #: Integer grids are written to it.
    GRID = auto()
    #: They may contain a second set of UVs beside those of textures.
    UV_SETS = auto()


#: Names of FreeSurfer's surfaces, which stand in the place of an ending: lh.pial. Others are recognized by content.
FREESURFER = (".pial", ".white", ".inflated", ".sphere", ".orig", ".smoothwm")
#: The uses of each format, by the ending of its files.
FORMATS = {
    ".obj": Use.MESH | Use.UV | Use.FLATTENING | Use.QUADS | Use.GRID,
    ".ply": Use.MESH | Use.UV | Use.FLATTENING | Use.QUADS,
    ".stl": Use.MESH | Use.QUADS,
    ".off": Use.MESH,
    ".gltf": Use.MESH | Use.UV,
    ".glb": Use.MESH | Use.UV | Use.FLATTENING | Use.QUADS | Use.UV_SETS,
    ".gii": Use.MESH,
    **dict.fromkeys(FREESURFER, Use.MESH),
    ".npz": Use.FLATTENING | Use.QUADS | Use.GRID,
    ".vtk": Use.MESHIO,
    ".vtu": Use.MESHIO,
    ".inp": Use.MESHIO,
    ".msh": Use.MESHIO,
}


def endings(use: Use) -> tuple[str, ...]:
    """Return the endings of the formats that have a use, or one of several, in the order of the table."""
    return tuple(ending for ending, uses in FORMATS.items() if uses & use)


def with_formats(text: str) -> str:
    """Return a help text in which {MESH}, {UV} and the other names of uses are replaced by lists of endings."""
    for use in Use:
        text = text.replace(f"{{{use.name}}}", _listed(use))
    return text


def _listed(use: Use) -> str:
    """Return the endings of a use as text; FreeSurfer's names are represented by one of them."""
    names = dict.fromkeys("lh.pial" if ending in FREESURFER else ending for ending in endings(use))
    *names_before, last = names
    return f"{', '.join(names_before)} or {last}" if names_before else last
