"""From whatever the user has to connected meshes that can be worked on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import BoolArray, FloatArray, IntArray
from ..errors import OptionError
from ..geometry import edge_lengths, mollify
from ..geometry.visibility import visible_share
from ..kept import Last
from ..mesh import TriangleMesh
from ..options import Options
from ..seams import CutMesh, edge_costs, open_along
from ..text import list_some, plural
from .arrays import InputMesh, as_input
from .constraints import Constraints, locate_constraints
from .marked_edges import edges_within, effective_marks, marked_edges, named_edges, out_of_reach
from .nearby import brought_together
from .numbering import at_unit_size, lengths_of_input, turn_corners
from .validation import CheckedMesh, check_mesh


@dataclass(frozen=True, eq=False)
class Component:
    """A connected mesh with what the user says of it.

    Attributes:
        mesh: the mesh.
        vertices, faces: (n,), (m,) those of the whole mesh; a vertex of a marked seam may be there several times.
        lengths: (m, 3) side lengths, with which every triangle has area.
        is_avoided: (m, 3) sides inside a polygon of the input, which should not be cut.
        is_forbidden: (m, 3) sides that must not be cut.
        visibility: (n,) what can be seen of each vertex, if that matters.
        constraints: what the user says of its vertices.
    """

    mesh: TriangleMesh
    vertices: IntArray
    faces: IntArray
    lengths: FloatArray
    is_avoided: BoolArray
    is_forbidden: BoolArray
    visibility: FloatArray | None
    constraints: Constraints


@dataclass(frozen=True, eq=False)
class Prepared:
    """A checked mesh.

    Attributes:
        given: the input.
        checked: the mesh, at a size of about one.
        notes: what was done to triangles without area, and which marks cut nothing.
        components: its connected parts, apart also where seams are marked.
        seams: (k, 2) vertices of the edges marked as seams.
        own_lengths: (m, 3) the side lengths that were given instead of those between vertices, or None.
    """

    given: InputMesh
    checked: CheckedMesh
    notes: tuple[str, ...]
    components: tuple[Component, ...]
    seams: IntArray
    own_lengths: FloatArray | None


#: A connected mesh, its vertices and faces in the whole one, and its (m, 3) side lengths.
Part: TypeAlias = tuple[TriangleMesh, IntArray, IntArray, FloatArray]


class Source:
    """An input, and what follows from it whatever else is asked of it.

    What was needed last is kept: another repair, other lengths or other marked seams take its place. As long as none
    does, components have the same meshes, the very objects.

    Attributes:
        given: the input, which must not change.
    """

    def __init__(self, given: InputMesh) -> None:
        self.given = given
        self._checked: Last[tuple[CheckedMesh, BoolArray]] = Last()
        self._lengths: Last[tuple[FloatArray, str | None]] = Last()
        self._seen: Last[FloatArray] = Last()
        self._parts: Last[tuple[Part, ...]] = Last()

    def prepared(self, options: Options) -> Prepared:
        """Check the input, and what the options say of its vertices.

        Raises:
            MeshError: the mesh cannot be flattened.
            OptionError: an option does not fit it.
        """
        given = self.given
        checked, is_diagonal = self._checked.of(options.repair, lambda: self._check(options.repair))
        own = _own_lengths(given, checked, options)
        metric = options.repair, options.strict, None if own is None else own.tobytes()
        lengths, note = self._lengths.of(metric, lambda: _open_triangles(checked, own, options.strict))
        constraints = locate_constraints(checked, options, given)
        notes = [] if note is None else [note]
        forbidden = np.zeros(len(checked.mesh.edges), dtype=bool)
        if options.forbidden_seams is not None:
            forbidden[named_edges(checked, np.asarray(options.forbidden_seams))] = True
        forbidden |= edges_within(checked, options.seamless, len(np.asarray(given.vertices)))
        marked = np.empty(0, dtype=np.int64)
        if options.marks_seams:
            marked, alone = effective_marks(checked.mesh, marked_edges(checked, options, given, forbidden))
            if len(alone):
                notes.append(_nothing_cut(constraints.names[checked.mesh.edges[alone]]))
            constraints.keep_off(checked.mesh.edges[marked])
            constraints = constraints.with_marks(checked.mesh.edges[marked])
        parts = self._parts.of((metric, marked.tobytes()), lambda: _parts(checked.mesh, marked, lengths))
        seen = self._visibility(checked, options) if options.hide_seams else None
        is_forbidden = forbidden[checked.mesh.halfedge_edges].reshape(-1, 3)
        components = tuple(
            Component(
                mesh,
                vertices,
                faces,
                own_lengths,
                is_diagonal[faces],
                is_forbidden[faces],
                None if seen is None else seen[vertices],
                _within_reach(constraints.within(vertices), mesh, is_forbidden[faces]),
            )
            for mesh, vertices, faces, own_lengths in parts
        )
        return Prepared(given, checked, tuple(notes), components, checked.mesh.edges[marked], own)

    def _check(self, repair: bool) -> tuple[CheckedMesh, BoolArray]:
        """Return the mesh, and (m, 3) its sides inside a polygon of the input."""
        checked = at_unit_size(check_mesh(self.given.vertices, self.given.faces, repair=repair))
        return checked, turn_corners(checked, ~self.given.is_side())

    def _visibility(self, checked: CheckedMesh, options: Options) -> FloatArray:
        up = None if options.up is None else np.array(options.up)
        key = options.repair, None if up is None else up.tobytes()
        return self._seen.of(key, lambda: visible_share(checked.mesh.vertices, checked.mesh.faces, up))


def prepare(mesh: Any, faces: ArrayLike | None, options: Options) -> Prepared:
    """Check a mesh, and what the options say of its vertices; see `coneflat.flatten` for the arguments.

    Raises:
        MeshError: the mesh cannot be flattened.
        OptionError: an option does not fit it.
    """
    return Source(as_input(mesh, faces)).prepared(options)


def _open_triangles(
    checked: CheckedMesh, own: FloatArray | None, strict: bool
) -> tuple[FloatArray, str | None]:
    """Return (m, 3) side lengths with which every triangle has area, and a note if they had to change."""
    lengths = edge_lengths(checked.mesh.vertices, checked.mesh.faces) if own is None else own
    return mollify(lengths, strict=strict, names=checked.face_origin)


def _parts(mesh: TriangleMesh, marked: IntArray, lengths: FloatArray) -> tuple[Part, ...]:
    """Return the connected parts of a mesh that is open along edges (k,)."""
    opened = open_along(mesh, marked) if len(marked) else CutMesh(mesh, np.arange(len(mesh.vertices)))
    parts = []
    for part, vertices, faces in opened.mesh.split_components():
        together = brought_together(part)
        if together is not None:
            part, vertices, faces = together[0], vertices[together[1]], faces[together[2]]
        parts.append((part, opened.origin[vertices], faces, lengths[faces]))
    return tuple(parts)


def _within_reach(constraints: Constraints, mesh: TriangleMesh, is_forbidden: BoolArray) -> Constraints:
    """Return constraints of a component that forbid cones where no seam gets."""
    return constraints.without(out_of_reach(mesh, is_forbidden)) if is_forbidden.any() else constraints


def _own_lengths(given: InputMesh, checked: CheckedMesh, options: Options) -> FloatArray | None:
    """Return (m, 3) the side lengths that the user gives, if he does."""
    if options.lengths is None:
        return None
    if given.source is not None:
        raise OptionError(
            "lengths are those of triangles given as arrays: give vertices and faces, not a file"
        )
    return lengths_of_input(checked, options.lengths, len(np.asarray(given.faces)))


def _nothing_cut(pairs: IntArray) -> str:
    names = list_some([f"{a}-{b}" for a, b in pairs[:5].tolist()], len(pairs))
    return f"Not cut: {plural(len(pairs), 'edge')} ({names}) that no other one meets, so both sides have the same ends."


def seam_costs(part: Component, options: Options) -> tuple[FloatArray, BoolArray, BoolArray]:
    """Return (e,) what each edge costs as part of a seam, whether it is to be avoided, and whether it is forbidden."""
    sides = part.mesh.edge_halfedges[:, 0]
    costs = edge_costs(
        part.mesh,
        part.lengths.ravel()[sides],
        creases=options.creases,
        hiding=options.hide_seams,
        visibility=part.visibility,
        vertex_weights=part.constraints.seam_weights,
    )
    return costs, part.is_avoided.ravel()[sides], part.is_forbidden.ravel()[sides]
