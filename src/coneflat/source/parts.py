"""From whatever the user has to connected meshes that can be worked on."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Generic, TypeAlias, TypeVar

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..base.text import list_some, plural
from ..errors import OptionError
from ..geometry import edge_lengths, mollify
from ..geometry.visibility import visible_share
from ..linalg.memory import check_memory
from ..mesh.check import CheckedMesh, check_mesh
from ..mesh.connectivity import TriangleMesh
from ..mesh.open_mesh import CutMesh, open_along
from ..options import Options
from ..stages import ConeSpec, MetricSpec, SeamSpec
from .constraints import Constraints, locate_constraints
from .input_mesh import InputMesh, at_unit_size, lengths_of_input, turn_corners
from .marked_edges import effective_marks, forbidden_edges, marked_edges, out_of_reach


@dataclass(frozen=True, eq=False)
class Part:
    """A connected mesh with n vertices and m faces, and what is asked of it.

    Attributes:
        mesh: the mesh.
        vertices, faces: (n,), (m,) those of the whole mesh; a vertex of a marked seam may be there several times.
        lengths: (m, 3) side lengths, with which every triangle has area.
        cones, metric, seams: what is asked of them.
    """

    mesh: TriangleMesh
    vertices: IntArray
    faces: IntArray
    lengths: FloatArray
    cones: ConeSpec
    metric: MetricSpec
    seams: SeamSpec

    @property
    def is_exact(self) -> bool:
        """Whether the metric may flip edges."""
        return self.metric.method == "exact"

    @property
    def where(self) -> str:
        """Where errors occur: a clause."""
        return f"in the component of vertex {self.cones.names[0]} ({len(self.faces):,} triangles)"


@dataclass(frozen=True, eq=False)
class Prepared:
    """A checked mesh.

    Attributes:
        given: the input.
        checked: the mesh, at a size of about one.
        notes: what was done to triangles without area, and which marks cut nothing.
        parts: its connected parts, separate also where seams are marked.
        seams: (k, 2) vertices of the edges marked as seams.
        own_lengths: (m, 3) the side lengths that were given instead of those between vertices, or None.
    """

    given: InputMesh
    checked: CheckedMesh
    notes: tuple[str, ...]
    parts: tuple[Part, ...]
    seams: IntArray
    own_lengths: FloatArray | None


#: A connected mesh, its vertices and faces in the whole one, and its (m, 3) side lengths.
Piece: TypeAlias = tuple[TriangleMesh, IntArray, IntArray, FloatArray]

Value = TypeVar("Value")


class LatestCache(Generic[Value]):
    """The value that was computed last, with the key that it was asked for by."""

    def __init__(self) -> None:
        self._known: tuple[Hashable, Value] | None = None

    def of(self, key: Hashable, compute: Callable[[], Value]) -> Value:
        """Return the value of a key: the last one, or one that is computed and takes its place.

        Where that fails, or is given up, the last one stays.
        """
        if self._known is None or self._known[0] != key:
            self._known = key, compute()
        return self._known[1]


class Source:
    """An input, and what follows from it whatever else is asked of it.

    The latest values are cached: another repair, other lengths or other marked seams replace them. Until then parts
    have the same mesh objects.

    Attributes:
        given: the input, which must not change.
    """

    def __init__(self, given: InputMesh) -> None:
        self.given = given
        self._checked: LatestCache[tuple[CheckedMesh, BoolArray]] = LatestCache()
        self._lengths: LatestCache[tuple[FloatArray, str | None]] = LatestCache()
        self._seen: LatestCache[FloatArray] = LatestCache()
        self._fits: LatestCache[None] = LatestCache()
        self._pieces: LatestCache[tuple[Piece, ...]] = LatestCache()

    def prepared(self, options: Options) -> Prepared:
        """Check the input, and what the options say of its vertices.

        Raises:
            MeshError: the mesh cannot be flattened.
            OptionError: an option does not fit it.
            SeamError: edges are both seams and not to be cut.
            TooLargeError: the mesh does not fit into the memory that is free.
        """
        given = self.given
        checked, is_diagonal = self._checked.of(options.repair, lambda: self._check(options.repair))
        own = _own_lengths(given, checked, options)
        metric = options.repair, options.strict, None if own is None else own.tobytes()
        lengths, note = self._lengths.of(metric, lambda: _open_triangles(checked, own, options.strict))
        constraints = locate_constraints(checked, options, given)
        notes = [] if note is None else [note]
        forbidden = forbidden_edges(checked, options, len(np.asarray(given.vertices)))
        marked = np.empty(0, dtype=np.int64)
        if options.marks_seams:
            marked, alone = effective_marks(checked.mesh, marked_edges(checked, options, given, forbidden))
            if len(alone):
                notes.append(_nothing_cut(constraints.names[checked.mesh.edges[alone]]))
            constraints.keep_off(checked.mesh.edges[marked])
            constraints = constraints.with_marks(checked.mesh.edges[marked])
        pieces = self._pieces.of((metric, marked.tobytes()), lambda: _pieces(checked.mesh, marked, lengths))
        seen = self._visibility(checked, options) if options.hide_seams else None
        is_forbidden = forbidden[checked.mesh.halfedge_edges].reshape(-1, 3)
        parts = tuple(
            _part(
                piece,
                _within_reach(constraints.within(piece[1]), piece[0], is_forbidden[piece[2]]),
                is_diagonal[piece[2]],
                is_forbidden[piece[2]],
                None if seen is None else seen[piece[1]],
                options,
            )
            for piece in pieces
        )
        # Asked once, as what is kept is no longer free.
        count = len(checked.mesh.faces)
        self._fits.of(count, lambda: check_memory(count))
        if options.boundary_kind != "free" and not any(part.mesh.is_boundary_vertex.any() for part in parts):
            notes.append(
                "The surface has no boundary, so that none of it is flattened to a given shape or length."
            )
        return Prepared(given, checked, tuple(notes), parts, checked.mesh.edges[marked], own)

    def _check(self, repair: bool) -> tuple[CheckedMesh, BoolArray]:
        """Return the mesh, and (m, 3) its sides inside a polygon of the input."""
        checked = at_unit_size(check_mesh(self.given.vertices, self.given.faces, repair=repair))
        return checked, turn_corners(checked, ~self.given.is_side())

    def _visibility(self, checked: CheckedMesh, options: Options) -> FloatArray:
        up = None if options.up is None else np.array(options.up)
        key = options.repair, None if up is None else up.tobytes()
        return self._seen.of(key, lambda: visible_share(checked.mesh.vertices, checked.mesh.faces, up))


def _open_triangles(
    checked: CheckedMesh, own: FloatArray | None, strict: bool
) -> tuple[FloatArray, str | None]:
    """Return (m, 3) side lengths with which every triangle has area, and a note if they had to change."""
    lengths = edge_lengths(checked.mesh.vertices, checked.mesh.faces) if own is None else own
    return mollify(lengths, strict=strict, names=checked.face_origin)


def _pieces(mesh: TriangleMesh, marked: IntArray, lengths: FloatArray) -> tuple[Piece, ...]:
    """Return the connected parts of a mesh that is open along edges (k,)."""
    opened = open_along(mesh, marked) if len(marked) else CutMesh(mesh, np.arange(len(mesh.vertices)))
    parts = []
    for part, vertices, faces in opened.mesh.split_components():
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


def _part(
    piece: Piece,
    said: Constraints,
    is_diagonal: BoolArray,
    is_forbidden: BoolArray,
    visibility: FloatArray | None,
    options: Options,
) -> Part:
    """Return a connected mesh with what is asked of it.

    Args:
        piece: the mesh.
        said: what the user says of its vertices.
        is_diagonal, is_forbidden: (m, 3) sides inside polygons of the input, and those that must not be cut.
        visibility: (n,) what can be seen of each vertex, or None.
        options: of everything.
    """
    mesh, vertices, faces, lengths = piece
    has_boundary, sides = bool(mesh.is_boundary_vertex.any()), mesh.edge_halfedges[:, 0]
    is_free = not has_boundary or (options.boundary_kind == "polygon" and not len(said.corners))
    kind = "free" if is_free else options.boundary_kind
    on_marks = np.zeros(len(vertices), dtype=bool) if said.on_marks is None else said.on_marks
    on_marks = mesh.is_boundary_vertex & on_marks
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
        given=said.cones,
        required=said.required.vertices,
        is_allowed=said.is_allowed,
        weights=said.weights,
        # Corners of a straightened boundary are searched like cones inside; but not on marked seams.
        absorbs_curvature=on_marks if kind == "straight" else mesh.is_boundary_vertex,
        prescribes_boundary=kind in ("disk", "polygon"),
        searches_corners=kind == "straight",
        scale_at_cones=options.scale_at_cones and options.method == "exact",
        names=said.names,
    )
    metric = MetricSpec(
        method=options.method,
        boundary=kind,
        corners=said.corners,
        # On marked seams, so that both sides are equal.
        keeps_length=mesh.is_boundary_vertex if kind == "lengths" else on_marks,
        keeps_area=kind != "lengths" and not options.marks_seams,
        scale_at_cones=options.scale_at_cones,
        quantum=options.quantise if options.correct_handles else None,
        names=said.names,
    )
    seams = SeamSpec(
        follows_sharp=options.sharp_angle is not None,
        hiding=options.hide_seams,
        visibility=visibility,
        weights=said.seam_weights,
        is_avoided=is_diagonal.ravel()[sides],
        is_forbidden=is_forbidden.ravel()[sides],
    )
    return Part(mesh, vertices, faces, lengths, cones, metric, seams)
