"""Preparation of the input: check, repair, and split into connected parts with their specifications."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Generic, TypeAlias, TypeVar

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
from ..stages import ConeSpec, MetricSpec, SeamSpec
from .constraints import Constraints, locate_constraints
from .input_mesh import InputMesh, at_unit_size, lengths_of_input, reorder_corners
from .marked_edges import effective_marks, forbidden_edges, marked_edges, unreachable
from .rounding import named_rounding, rounding_notes


@dataclass(frozen=True, eq=False)
class Component:
    """A connected part of the input with n vertices and m faces, and the specifications of its stages.

    Attributes:
        mesh: the mesh.
        vertices, faces: (n,), (m,) indices in the whole mesh; a vertex on a marked seam may occur several times.
        lengths: (m, 3) side lengths, with which every triangle has area.
        double_areas: (m,) twice the areas of the triangles before any were opened.
        cones, metric, seams: specifications.
    """

    mesh: TriangleMesh
    vertices: IntArray
    faces: IntArray
    lengths: FloatArray
    double_areas: FloatArray
    cones: ConeSpec
    metric: MetricSpec
    seams: SeamSpec

    @property
    def is_exact(self) -> bool:
        """Whether the metric may flip edges."""
        return self.metric.method == "exact"

    @property
    def location(self) -> str:
        """The vertex and the number of triangles by which messages name the component."""
        return f"in the component of vertex {self.cones.names[0]} ({len(self.faces):,} triangles)"

    def with_distortion(self, factor: float) -> Component:
        """Return the component with another bound of the area distortion, multiplied by a factor."""
        return replace(self, cones=replace(self.cones, distortion=factor * self.cones.distortion))


@dataclass(frozen=True, eq=False)
class Prepared:
    """The checked input, split into components.

    Attributes:
        input_mesh: the input.
        checked: the mesh, scaled to about unit size.
        notes: notes on opened triangles without area, on marked edges that cut nothing, and on a missing boundary.
        components: connected parts of the mesh, which marked seams also separate.
        seams: (k, 2) vertices of the edges marked as seams.
        user_lengths: (m, 3) the side lengths given by the user instead of distances between vertices, or None.
    """

    input_mesh: InputMesh
    checked: CheckedMesh
    notes: tuple[str, ...]
    components: tuple[Component, ...]
    seams: IntArray
    user_lengths: FloatArray | None

    def pieces_of(self, coarser: Prepared, chosen: Sequence[int]) -> dict[int, list[Component]]:
        """Return the components that lie in chosen components of the same input with fewer seams."""
        coarse_component = np.full(len(self.checked.mesh.faces), -1)
        for i in chosen:
            coarse_component[coarser.components[i].faces] = i
        pieces: dict[int, list[Component]] = {i: [] for i in chosen}
        for component in self.components:
            if (i := int(coarse_component[component.faces[0]])) >= 0:
                pieces[i].append(component)
        return pieces

    def with_pieces(self, finer: Prepared, pieces: Mapping[int, Sequence[Component]]) -> Prepared:
        """Return the input with some components replaced by their pieces, and with the seams between these.

        Args:
            finer: the same input with more seams.
            pieces: the pieces of components, from `pieces_of`.
        """
        is_cut = mask_of(
            len(self.checked.mesh.vertices), np.concatenate([self.components[i].vertices for i in pieces])
        )
        seams = np.concatenate([self.seams, finer.seams[is_cut[finer.seams].all(axis=1)]])
        components = [
            piece for i, component in enumerate(self.components) for piece in pieces.get(i, [component])
        ]
        return replace(self, components=tuple(components), seams=np.unique(seams, axis=0))


#: A connected mesh, the indices of its vertices and faces in the whole mesh, and its (m, 3) side lengths.
Piece: TypeAlias = tuple[TriangleMesh, IntArray, IntArray, FloatArray]

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
        self._seen: LatestCache[FloatArray] = LatestCache()
        self._fits: LatestCache[None] = LatestCache()
        self._pieces: LatestCache[tuple[Piece, ...]] = LatestCache()

    def checked(self, repair: bool) -> CheckedMesh:
        """Return the checked input, scaled to about unit size.

        Raises:
            MeshError: the mesh cannot be flattened.
        """
        return self._checked.of(repair, lambda: self._check(repair))[0]

    def prepared(self, options: Options) -> Prepared:
        """Return the checked input, split into components with the specifications that the options give.

        Raises:
            MeshError: the mesh cannot be flattened.
            OptionError: an option does not fit the mesh.
            SeamError: an edge is both marked as a seam and forbidden.
            TooLargeError: the mesh does not fit into the free memory.
        """
        input_mesh = self.input_mesh
        checked, is_diagonal = self._checked.of(options.repair, lambda: self._check(options.repair))
        user_lengths = _user_lengths(input_mesh, checked, options)
        metric = options.repair, options.strict, None if user_lengths is None else user_lengths.tobytes()
        with named_rounding(input_mesh.vertices, input_mesh.faces):
            lengths, note = self._lengths.of(
                metric, lambda: _open_triangles(checked, user_lengths, options.strict)
            )
        constraints = locate_constraints(checked, options, input_mesh)
        notes = [] if note is None else [note]
        if note is not None or len(checked.face_origin) < len(np.asarray(input_mesh.faces)):
            notes += rounding_notes(input_mesh.vertices, input_mesh.faces)
        forbidden = forbidden_edges(checked, options, len(np.asarray(input_mesh.vertices)))
        marked = np.empty(0, dtype=np.int64)
        if options.marks_seams:
            marked, isolated = effective_marks(
                checked.mesh, marked_edges(checked, options, input_mesh, forbidden)
            )
            if len(isolated):
                notes.append(_isolated_note(constraints.names[checked.mesh.edges[isolated]]))
            constraints.check_off_seams(checked.mesh.edges[marked])
            on_marks = mask_of(len(constraints.names), checked.mesh.edges[marked])
            constraints = replace(constraints, on_marks=on_marks)
        pieces = self._pieces.of((metric, marked.tobytes()), lambda: _pieces(checked.mesh, marked, lengths))
        seen = self._visibility(checked, options) if options.hide_seams else None
        is_forbidden = forbidden[checked.mesh.halfedge_edges].reshape(-1, 3)
        areas = double_areas(
            edge_lengths(checked.mesh.vertices, checked.mesh.faces) if user_lengths is None else lengths
        )
        components = tuple(
            _component(
                piece,
                constraints.within(piece[1]),
                is_diagonal[piece[2]],
                is_forbidden[piece[2]],
                None if seen is None else seen[piece[1]],
                areas[piece[2]],
                options,
            )
            for piece in pieces
        )
        # The memory is checked once only, because cached values are no longer free.
        count = len(checked.mesh.faces)
        self._fits.of(count, lambda: check_memory(count))
        if options.boundary_kind != "free" and not any(
            component.mesh.is_boundary_vertex.any() for component in components
        ):
            notes.append("The surface has no boundary, so the option boundary has no effect.")
        return Prepared(
            input_mesh, checked, tuple(notes), components, checked.mesh.edges[marked], user_lengths
        )

    def _check(self, repair: bool) -> tuple[CheckedMesh, BoolArray]:
        """Return the checked mesh, and (m, 3) which of its sides are inside a polygon of the input."""
        dropped = _short_faces(self.input_mesh, repair)
        with named_rounding(self.input_mesh.vertices, self.input_mesh.faces):
            checked = at_unit_size(check_mesh(self.input_mesh.vertices, self.input_mesh.faces, repair=repair))
        checked = replace(checked, notes=(*dropped, *checked.notes))
        return checked, reorder_corners(checked, ~self.input_mesh.is_side())

    def _visibility(self, checked: CheckedMesh, options: Options) -> FloatArray:
        up = None if options.up is None else np.array(options.up)
        key = options.repair, None if up is None else up.tobytes()
        return self._seen.of(key, lambda: visible_share(checked.mesh.vertices, checked.mesh.faces, up))


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


def _open_triangles(
    checked: CheckedMesh, user_lengths: FloatArray | None, strict: bool
) -> tuple[FloatArray, str | None]:
    """Return (m, 3) side lengths with which every triangle has area, and a note if lengths were changed."""
    lengths = (
        edge_lengths(checked.mesh.vertices, checked.mesh.faces) if user_lengths is None else user_lengths
    )
    return mollify(lengths, checked.mesh, strict=strict, names=checked.face_origin)


def _pieces(mesh: TriangleMesh, marked: IntArray, lengths: FloatArray) -> tuple[Piece, ...]:
    """Return the connected parts of a mesh after cutting it along edges (k,)."""
    opened = open_along(mesh, marked) if len(marked) else CutMesh(mesh, np.arange(len(mesh.vertices)))
    components = opened.mesh.split_components()
    return tuple((component, opened.origin[at], faces, lengths[faces]) for component, at, faces in components)


def _user_lengths(input_mesh: InputMesh, checked: CheckedMesh, options: Options) -> FloatArray | None:
    """Return (m, 3) the side lengths given by the user, or None."""
    if options.lengths is None:
        return None
    if input_mesh.source is not None:
        raise OptionError(
            "lengths can be given for a mesh of arrays only: give vertices and faces, not a file"
        )
    return lengths_of_input(checked, options.lengths, len(np.asarray(input_mesh.faces)))


def _isolated_note(pairs: IntArray) -> Unmet:
    names = list_some([f"{a}-{b}" for a, b in pairs[:5].tolist()], len(pairs))
    return Unmet(
        f"Not cut: {plural(len(pairs), 'edge')} ({names}) marked as seams that touch no other seam and no boundary."
    )


def _component(
    piece: Piece,
    limits: Constraints,
    is_diagonal: BoolArray,
    is_forbidden: BoolArray,
    visibility: FloatArray | None,
    areas: FloatArray,
    options: Options,
) -> Component:
    """Return a component with its specifications.

    Args:
        piece: the mesh.
        limits: constraints on its vertices.
        is_diagonal, is_forbidden: (m, 3) sides inside polygons of the input, and sides that must not be cut.
        visibility: (n,) fraction of directions from which each vertex is visible, or None.
        areas: (m,) twice the areas of its triangles before any were opened.
        options: all options.
    """
    mesh, vertices, faces, lengths = piece
    has_boundary, sides = bool(mesh.is_boundary_vertex.any()), mesh.edge_halfedges[:, 0]
    is_free = not has_boundary or (options.boundary_kind == "polygon" and not len(limits.corners))
    kind = "free" if is_free else options.boundary_kind
    on_marks = mesh.is_boundary_vertex & (False if limits.on_marks is None else limits.on_marks)
    cones = ConeSpec(
        strategy=options.cone_choice,
        needs_sparse_search=options.asks_for_search,
        distortion=options.distortion,
        count=options.cone_count,
        max_count=options.max_cones,
        min_angle=options.min_cone_angle,
        max_angle=options.max_cone_angle,
        positive_only=options.positive_only,
        quantum=options.quantise,
        prescribed=limits.cones,
        required=limits.required.vertices,
        is_allowed=limits.is_allowed,
        weights=limits.weights,
        # Corners of a straightened boundary are searched like inner cones, but not on marked seams.
        absorbs_curvature=on_marks if kind == "straight" else mesh.is_boundary_vertex,
        prescribes_boundary=kind in ("disk", "polygon"),
        searches_corners=kind == "straight",
        scale_at_cones=options.scale_at_cones and options.method == "exact",
        names=limits.names,
    )
    if is_forbidden.any():  # no cones where no seam can reach them
        cones = cones.without(unreachable(mesh, is_forbidden))
    metric = MetricSpec(
        method=options.method,
        boundary=kind,
        corners=limits.corners,
        # Lengths are preserved on marked seams, so that both sides are equal.
        keeps_length=mesh.is_boundary_vertex if kind == "lengths" else on_marks,
        keeps_area=kind != "lengths" and not options.marks_seams,
        scale_at_cones=options.scale_at_cones,
        quantum=options.quantise if options.correct_handles else None,
        names=limits.names,
    )
    seams = SeamSpec(
        creases=float(options.sharp_angle is not None),
        hiding=options.hide_seams,
        visibility=visibility,
        weights=limits.seam_weights,
        is_avoided=is_diagonal.ravel()[sides],
        is_forbidden=is_forbidden.ravel()[sides],
    )
    return Component(mesh, vertices, faces, lengths, areas, cones, metric, seams)
