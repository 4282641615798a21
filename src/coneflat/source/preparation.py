"""Preparation of the input: check, repair, and split into connected components with their specifications."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import replace
from typing import Generic, TypeVar

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray, mask_of
from ..base.notes import Unmet
from ..base.text import list_some, plural
from ..errors import DegenerateFaceError, OptionError
from ..geometry import double_areas, edge_lengths, mollify
from ..geometry.visibility import visible_share
from ..linalg.memory import check_memory
from ..mesh.charts import CutMesh, open_along
from ..mesh.check import REPAIR_ADVICE, CheckedMesh, check_mesh, short_faces_note
from ..mesh.connectivity import TriangleMesh
from ..options import Options
from .components import Prepared
from .constraints import locate_constraints
from .fill import Fill
from .input_mesh import InputMesh, at_unit_size, lengths_of_input, reorder_corners
from .marked_edges import effective_marks, forbidden_edges, marked_edges
from .rounding import named_rounding, rounding_notes
from .specifications import MeshValues, Submesh, specified_component

Value = TypeVar("Value")


class LatestCache(Generic[Value]):
    """A cache of one value: the value that was computed last, and its key."""

    def __init__(self) -> None:
        self._entry: tuple[Hashable, Value] | None = None

    def of(self, key: Hashable, compute: Callable[[], Value]) -> Value:
        """Return the cached value if the key is the same, else compute and cache the value.

        If the computation raises an exception, the cache does not change.
        """
        if self._entry is None or self._entry[0] != key:
            self._entry = key, compute()
        return self._entry[1]


class Source:
    """An input, with a cache of the values that depend on few options.

    The latest values are cached; another repair, other lengths or other marked seams replace them. Until then,
    components share the same mesh objects.

    Attributes:
        input_mesh: the input, which must not be modified.
    """

    def __init__(self, input_mesh: InputMesh) -> None:
        self.input_mesh = input_mesh
        self._checked: LatestCache[tuple[CheckedMesh, BoolArray]] = LatestCache()
        self._lengths: LatestCache[tuple[FloatArray, str | None]] = LatestCache()
        self._visibility: LatestCache[FloatArray] = LatestCache()
        self._memory: LatestCache[None] = LatestCache()
        self._submeshes: LatestCache[tuple[Submesh, ...]] = LatestCache()

    def checked(self, repair: bool) -> CheckedMesh:
        """Return the checked input, scaled to about unit size.

        Raises:
            MeshError: the mesh cannot be flattened.
        """
        return self._checked_sides(repair)[0]

    def prepared(self, options: Options) -> Prepared:
        """Return the checked input, split into components with the specifications that the options give.

        The mesh is checked, thin triangles are opened, the options for vertices and edges are located, and the mesh is
        cut along marked seams and split.

        Raises:
            MeshError: the mesh cannot be flattened.
            OptionError: an option does not fit the mesh.
            SeamError: an edge is both marked as a seam and forbidden.
            TooLargeError: the mesh does not fit into the free memory.
        """
        checked, is_diagonal = self._checked_sides(options.repair)
        user_lengths = _user_lengths(self.input_mesh, checked, options)
        key = options.repair, options.strict, None if user_lengths is None else user_lengths.tobytes()
        lengths, opening_notes = self._opened(key, checked, user_lengths)
        constraints = locate_constraints(checked, options, self.input_mesh)
        is_forbidden = forbidden_edges(checked, options, len(np.asarray(self.input_mesh.vertices)))
        marked, isolated_notes = _marked(checked, options, self.input_mesh, is_forbidden)
        seams = checked.mesh.edges[marked]
        if options.marks_seams:
            constraints.check_off_seams(seams)
            constraints = replace(constraints, on_marks=mask_of(len(constraints.names), seams))
        submeshes = self._submeshes.of(
            (key, marked.tobytes()),
            lambda: _split(checked.mesh, marked, lengths, fills_holes=user_lengths is None),
        )
        values = MeshValues(
            constraints,
            is_diagonal,
            is_forbidden[checked.mesh.halfedge_edges].reshape(-1, 3),
            self._visibility_of(checked, options) if options.hide_seams else None,
            double_areas(_distances(checked.mesh) if user_lengths is None else lengths),
        )
        components = tuple(specified_component(submesh, values, options) for submesh in submeshes)
        # The memory is checked once only, because cached values are no longer free.
        count = len(checked.mesh.faces)
        self._memory.of(count, lambda: check_memory(count))
        notes = (*opening_notes, *isolated_notes, *_boundary_notes(checked.mesh, seams, options))
        return Prepared(self.input_mesh, checked, notes, components, seams, user_lengths)

    def _checked_sides(self, repair: bool) -> tuple[CheckedMesh, BoolArray]:
        """Return the checked mesh, and (m, 3) which of its sides are inside a polygon of the input."""
        return self._checked.of(repair, lambda: _check(self.input_mesh, repair))

    def _opened(
        self, key: tuple[bool, bool, bytes | None], checked: CheckedMesh, user_lengths: FloatArray | None
    ) -> tuple[FloatArray, list[str]]:
        """Return (m, 3) side lengths with which every triangle has area, and notes on triangles without.

        Args:
            key: the options `repair` and `strict`, and the bytes of the user's lengths.
            checked: the mesh.
            user_lengths: (m, 3) the side lengths given by the user, or None.
        """
        lengths = _distances(checked.mesh) if user_lengths is None else user_lengths

        def compute() -> tuple[FloatArray, str | None]:
            return mollify(lengths, checked.mesh, strict=key[1], names=checked.face_origin)

        vertices, faces = self.input_mesh.vertices, self.input_mesh.faces
        with named_rounding(vertices, faces):
            opened, note = self._lengths.of(key, compute)
        notes = [] if note is None else [note]
        if note is not None or len(checked.face_origin) < len(np.asarray(faces)):
            notes += rounding_notes(vertices, faces)
        return opened, notes

    def _visibility_of(self, checked: CheckedMesh, options: Options) -> FloatArray:
        """Return (n,) the fraction of directions from which each vertex is visible."""
        up = None if options.up is None else np.array(options.up)
        key = options.repair, None if up is None else up.tobytes()
        return self._visibility.of(key, lambda: visible_share(checked.mesh.vertices, checked.mesh.faces, up))


def _check(input_mesh: InputMesh, repair: bool) -> tuple[CheckedMesh, BoolArray]:
    """Return the checked mesh, and (m, 3) which of its sides are inside a polygon of the input."""
    dropped = _short_faces(input_mesh, repair)
    with named_rounding(input_mesh.vertices, input_mesh.faces):
        checked = at_unit_size(check_mesh(input_mesh.vertices, input_mesh.faces, repair=repair))
    checked = replace(checked, notes=(*dropped, *checked.notes))
    return checked, reorder_corners(checked, ~input_mesh.is_side())


def _short_faces(input_mesh: InputMesh, repair: bool) -> tuple[str, ...]:
    """Return a note on faces of the file with fewer than three corners, which are left out.

    Raises:
        DegenerateFaceError: there are some, and the mesh is not repaired.
    """
    count = 0 if input_mesh.source is None else input_mesh.source.short_faces
    if not count:
        return ()
    if not repair:
        raise DegenerateFaceError(
            f"{plural(count, 'face')} with fewer than three corners; {REPAIR_ADVICE} to drop them"
        )
    return (short_faces_note(count),)


def _distances(mesh: TriangleMesh) -> FloatArray:
    """Return (m, 3) the distances of the vertices at the ends of sides."""
    return edge_lengths(mesh.vertices, mesh.faces)


def _user_lengths(input_mesh: InputMesh, checked: CheckedMesh, options: Options) -> FloatArray | None:
    """Return (m, 3) the side lengths given by the user, or None."""
    if options.lengths is None:
        return None
    if input_mesh.source is not None:
        raise OptionError(
            "lengths can be given for a mesh of arrays only: give vertices and faces, not a file"
        )
    return lengths_of_input(checked, options.lengths, len(np.asarray(input_mesh.faces)))


def _marked(
    checked: CheckedMesh, options: Options, input_mesh: InputMesh, is_forbidden: BoolArray
) -> tuple[IntArray, list[str]]:
    """Return the marked edges that cut the mesh, and a note on marked edges that do not; is_forbidden: (e,)."""
    if not options.marks_seams:
        return np.empty(0, dtype=np.int64), []
    is_marked = marked_edges(checked, options, input_mesh, is_forbidden)
    marked, isolated = effective_marks(checked.mesh, is_marked)
    notes = [_isolated_note(checked.vertex_origin[checked.mesh.edges[isolated]])] if len(isolated) else []
    return marked, list(notes)


def _isolated_note(pairs: IntArray) -> Unmet:
    names = list_some([f"{a}-{b}" for a, b in pairs[:5].tolist()], len(pairs))
    return Unmet(
        f"Not cut: {plural(len(pairs), 'edge')} ({names}) marked as seams that touch no other seam and no boundary."
    )


def _boundary_notes(mesh: TriangleMesh, seams: IntArray, options: Options) -> list[str]:
    """Return a note if an option for the boundary has no effect; seams: (k, 2) edges that open the mesh."""
    if options.boundary_kind == "free" or len(seams) or mesh.is_boundary_vertex.any():
        return []
    return ["The surface has no boundary, so the option boundary has no effect."]


def _split(
    mesh: TriangleMesh, marked: IntArray, lengths: FloatArray, fills_holes: bool
) -> tuple[Submesh, ...]:
    """Return the connected components of a mesh after cutting it along edges.

    Args:
        mesh: the mesh.
        marked: (k,) the edges; holes that they open are not filled.
        lengths: (m, 3) side lengths.
        fills_holes: whether lengths are distances of vertices, so that holes can be filled.
    """
    opened = open_along(mesh, marked) if len(marked) else CutMesh(mesh, np.arange(len(mesh.vertices)))
    is_marked = mask_of(len(mesh.vertices), mesh.edges[marked])[opened.origin]
    submeshes = []
    for component, vertices, faces in opened.mesh.split_components():
        fill = Fill.of(component, lengths[faces], is_marked[vertices]) if fills_holes else None
        submeshes.append(Submesh(component, opened.origin[vertices], faces, lengths[faces], fill))
    return tuple(submeshes)
