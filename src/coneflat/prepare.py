"""From whatever the user has to connected meshes that can be worked on."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike

from ._arrays import BoolArray, FloatArray, IntArray
from .geometry import edge_lengths, mollify
from .inputs import InputMesh, as_input
from .mesh import TriangleMesh
from .numbering import at_unit_size, turn_corners
from .options import Options
from .validation import CheckedMesh, check_mesh
from .wishes import Wishes, locate_wishes


@dataclass(frozen=True, eq=False)
class Component:
    """A connected mesh with what the user says of it.

    Attributes:
        mesh: the mesh.
        vertices, faces: (n,), (m,) those of the whole mesh.
        lengths: (m, 3) side lengths, with which every triangle has area.
        is_diagonal: (m, 3) sides inside a polygon of the input, which should not be cut.
        wishes: what the user says of its vertices.
    """

    mesh: TriangleMesh
    vertices: IntArray
    faces: IntArray
    lengths: FloatArray
    is_diagonal: BoolArray
    wishes: Wishes


@dataclass(frozen=True, eq=False)
class Prepared:
    """A checked mesh.

    Attributes:
        given: the input.
        checked: the mesh, at a size of about one.
        notes: what was done to triangles without area.
        components: its connected parts.
    """

    given: InputMesh
    checked: CheckedMesh
    notes: tuple[str, ...]
    components: tuple[Component, ...]


def prepare(mesh: Any, faces: ArrayLike | None, options: Options) -> Prepared:
    """Check a mesh, and what the options say of its vertices; see `coneflat.flatten` for the arguments.

    Raises:
        MeshError: the mesh cannot be flattened.
        OptionError: an option does not fit it.
    """
    given = as_input(mesh, faces)
    checked = at_unit_size(check_mesh(given.vertices, given.faces, repair=options.repair))
    lengths, note = mollify(
        edge_lengths(checked.mesh.vertices, checked.mesh.faces),
        strict=options.strict,
        names=checked.face_origin,
    )
    is_diagonal = turn_corners(checked, ~given.is_side())
    wishes = locate_wishes(checked, options, given)

    def components() -> Iterator[Component]:
        for part, vertices, part_faces in checked.mesh.split_components():
            shape = lengths[part_faces], is_diagonal[part_faces]
            yield Component(part, vertices, part_faces, *shape, wishes.within(vertices))

    return Prepared(given, checked, () if note is None else (note,), tuple(components()))
