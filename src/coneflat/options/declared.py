"""The options of a flattening: each is declared here, and here alone.

A field of a group below is an option: its name, type, default, kind with bounds, and what it means. The keywords of
`coneflat.flatten`, `find_cones` and `cone_curve`, the flags of the commands, what `coneflat batch` writes down, the
settings in the report and the tables in the documentation are made from it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ..progress import Progress
from ..threads import THREADS
from .kinds import (
    Choice,
    Count,
    Direction,
    Edges,
    Flag,
    Kind,
    Most,
    Number,
    Strength,
    Vertices,
    Weights,
    Whole,
    WordOrVertices,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

CONES = ("auto", "pursuit", "greedy", "none")
#: From cones to a layout: this package's own, the paper's, and those that it compares with.
METHODS = ("exact", "linear", "circle-patterns", "ricci", "linear-abf", "abf++", "lscm", "spectral", "bff")
#: As some of them were used in 2008: circle patterns without flips, and angles that prescribe nothing at cones.
VARIANTS = ("circle-patterns/fixed", "linear-abf/free", "abf++/free")
# Those that solve what need not converge.
ITERATIVE = ("exact", "circle-patterns", "circle-patterns/fixed", "ricci", "abf++", "abf++/free")
# Those whose metric lives on flipped triangles and is unfolded on the mesh's own.
UNFOLDED = ("exact", "circle-patterns", "circle-patterns/fixed", "ricci")
# Those whose cones have the curvatures that are prescribed; the others lay out what was cut open before.
CONED = (*UNFOLDED, "linear", "bff", "linear-abf", "abf++")
#: Which triangles of a flat metric are relaxed.
POLISHES = ("auto", "off", "whole")
SOLVERS = ("auto", "pardiso", "cholespy", "scipy", "amg")
CHARTS = ("atlas", "one")
BOUNDARIES = ("free", "lengths", "disk", "straight")
SYMMETRIES = ("auto", "x", "y", "z", "off")
MIRRORED = ("apart", "overlap")

# Radians: finer quanta than this restrict nothing that could be told from none, as multiples are known to 1e-6.
LEAST_QUANTUM = 1e-4
# Radians: no triangulation has room for wider cones than this.
WIDEST_CONE = 1000 * math.pi
# A preference for creases or hidden places of 1 makes seams ten times cheaper; with a factor of more than 1e10, the
# lengths of seams are beneath the rounding of their costs.
MOST_PREFERENCE = 10.0

Cones = str | Mapping[int, float] | Mapping[int, float | None] | Iterable[int]

#: The published method: `flatten(mesh, **PAPER)`.
PAPER: Mapping[str, Any] = {
    "cones": "greedy",
    "epsilon": 1.0,
    "max_cones": None,
    "method": "linear",
    "charts": "one",
}


@dataclass(frozen=True)
class Declaration:
    """What is declared of an option beside its name, type and default.

    Attributes:
        kind: what values it takes.
        doc: what it means, for people at the command line and in Python alike.
        only: what alone has this choice: "pursuit" or "greedy" for cones, "exact" for the method; or "".
        one_mesh: it names vertices of one mesh, so it fits no others.
        flag: the commands have it.
        command_default: what they take by default if it is not what Python takes; the reason stands beside it.
    """

    kind: Kind
    doc: str
    only: str = ""
    one_mesh: bool = False
    flag: bool = True
    command_default: Any = None


def option(default: Any, kind: Kind, doc: str, **more: Any) -> Any:
    """Return a field of a group, with its declaration."""
    return field(default=default, metadata={"declaration": Declaration(kind, doc, **more)})


@dataclass(frozen=True, kw_only=True)
class ConeBounds:
    """Cones: of which angles, and where."""

    min_cone_angle: float = option(
        math.pi / 2,
        Number(is_angle=True),
        "The sharpest cone: its angle, 2 pi less its curvature. Needles distort what is around them.",
        only="pursuit",
    )
    max_cone_angle: float | None = option(
        4 * math.pi,
        Number(is_angle=True, optional=True),
        "The widest saddle: its angle, above 2 pi; none or inf for any. Wider ones have no room in triangles.",
        only="pursuit",
    )
    positive_only: bool = option(
        False, Flag(), "No cones of negative curvature, which are saddles.", only="pursuit"
    )
    weights: ArrayLike | Mapping[int, float] | str | None = option(
        None,
        Weights(),
        "Importance of each vertex, from which distortion keeps off: numbers, or a map of vertices to theirs, where "
        "others are 1; the name of a property in the file; or color, where grey vertices are 1, those of a pure "
        "colour 100.",
        only="pursuit",
    )
    required_cones: Iterable[int] = option(
        (), Vertices(), "Vertices that are cones in any case.", only="pursuit", one_mesh=True
    )
    forbidden_cones: Iterable[int] = option(
        (), Vertices(), "Vertices that may not be cones.", only="pursuit", one_mesh=True
    )
    allowed_cones: Iterable[int] | None = option(
        None, Vertices(optional=True), "Vertices that alone may be cones.", only="pursuit", one_mesh=True
    )


@dataclass(frozen=True, kw_only=True)
class ConeNumber:
    """Cones: how many."""

    distortion: float = option(
        0.2,
        Number(positive=True),
        "The area distortion allowed, the standard deviation of the log of the scale by area; less needs more cones.",
        only="pursuit",
    )
    cone_count: int | None = option(
        None,
        Count(),
        "So many cones per component, placed for the least area distortion, instead.",
        only="pursuit",
    )


@dataclass(frozen=True, kw_only=True)
class ConeOptions(ConeBounds, ConeNumber):
    """Cones."""

    cones: Cones = option(
        "auto",
        WordOrVertices(CONES, "cone", may_differ=True),
        "How cones are found. pursuit: the fewest for the distortion allowed. greedy: the paper's search, which takes "
        "three to six times as many. none: none, for bounded meshes and tori. Or vertices, each with its curvature, "
        "or all without: the best curvatures are computed then; or some without, which have the least area distortion "
        "beside the others. auto: pursuit, but none where the boundary is prescribed, the corners of a polyhedron that "
        "has few, and greedy where handles need over a hundred.",
    )
    max_cones: int | None = option(None, Count(), "Searches stop at so many cones per component.")
    quality: float | None = option(
        None,
        Number(optional=True),
        "The mean quasi-conformal distortion wanted, 1.05 say: all triangles are relaxed, and there are up to a fifth "
        "more cones, as few as reach it. A note says where they do not.",
        only="pursuit",
    )
    quantise: float | None = option(
        None,
        Number(is_angle=True, optional=True),
        "Cones have curvatures that are multiples of this, pi/2 say, so that seams turn by such multiples.",
        only="pursuit",
    )
    correct_handles: bool = option(
        False,
        Flag(),
        "With quantised cones and the exact metric: make rotations along handles, and around holes where the boundary "
        "is free, multiples, too, by a map that is as little off conformal as can be.",
        only="pursuit",
    )
    epsilon: float = option(
        1.0,
        Number(positive=True),
        "The greedy search stops when the log of the scale varies by at most this.",
        only="greedy",
    )


@dataclass(frozen=True, kw_only=True)
class MetricOptions:
    """Metric."""

    method: str = option(
        "exact",
        Choice(METHODS),
        "exact: no curvature error, and no flipped triangle. linear: the paper's linear system and least squares. The "
        "others are there for comparison.",
    )
    boundary: Cones = option(
        "free",
        WordOrVertices(BOUNDARIES, "corner", "boundary names no corners; for a round boundary, say 'disk'"),
        "Exact metric: free has the least area distortion. lengths is the same at the model's own scale, so that "
        "lengths on the boundary are kept. disk is round. straight has straight sides between corners that the search "
        "finds like cones. Or the corners of a polygon, vertices with curvatures, or all without for equal angles.",
        only="exact",
    )
    refine: bool = option(
        False,
        Flag(),
        "Exact metric: cut the input's triangles along the edges of the flat triangulation, which carries the exact "
        "map; nothing can be inverted there. Polygons and groups are not kept.",
        only="exact",
    )
    polish: str = option(
        "auto",
        Choice(POLISHES),
        "Exact metric: less distortion of triangles, with the same cones, curvatures and seams. auto: those with a "
        "quasi-conformal distortion above 1.35, beside cones, and three rings around them. whole: all. off: none, so "
        "that the map is discretely conformal everywhere.",
        only="exact",
    )
    stretch: float = option(
        0.0,
        Strength(1.0),
        "Exact metric: from angles, 0, to areas, 1, which is as near to isometric as the cones allow. More than 0 "
        "moves all vertices, except on a boundary that is prescribed.",
        only="exact",
    )
    split: bool = option(
        True,
        Flag(),
        "Where triangles would be inverted on straight sides whatever is moved, as around a cone that is too wide for "
        "them, cut them, and no others, with a note. Without, the result has the input's own triangles, some inverted.",
    )
    best_effort: bool = option(
        False, Flag(), "Give a result even if the metric did not converge, which is refused otherwise."
    )


@dataclass(frozen=True, kw_only=True)
class SeamOptions:
    """Seams."""

    seams: ArrayLike | str | tuple[str, ArrayLike] | None = option(
        None,
        Edges(("input",)),
        "Edges that are cut in any case, pairs of vertices, or input: the seams of the file's own UVs, or both, as "
        '("input", pairs). They act like a boundary. An edge that no other meets is no cut.',
        one_mesh=True,
    )
    forbidden_seams: ArrayLike | None = option(
        None,
        Edges(),
        "Edges, pairs of vertices, that the first cut must not use, not for sharp edges or seams of the file either; "
        "what is cut later so that nothing overlaps avoids them where it can.",
        one_mesh=True,
    )
    seamless: Iterable[int] = option(
        (),
        Vertices(),
        "Vertices of regions without seams: an edge between two of them is one of forbidden_seams, and no search puts "
        "a cone where no seam gets.",
        one_mesh=True,
    )
    sharp_angle: float | None = option(
        None,
        Number(is_angle=True, optional=True),
        "Cut edges at which the surface bends by more, 40deg say: CAD parts open there.",
    )
    creases: float = option(
        0.0,
        Strength(MOST_PREFERENCE),
        "How much seams prefer sharp edges: at 1, one of 60 degrees and more costs a tenth of its length.",
    )
    hide_seams: float = option(
        0.0,
        Strength(MOST_PREFERENCE),
        "How much seams prefer what can hardly be seen, in deep folds and, with a direction up, below: at 1, it costs "
        "a tenth of its length.",
    )
    seam_weights: ArrayLike | str | None = option(
        None,
        Weights(),
        "By how much seams are dearer at each vertex: numbers, or the name of a property in the file.",
    )


@dataclass(frozen=True, kw_only=True)
class SymmetryOptions:
    """Symmetry."""

    symmetric: str = option(
        "off",
        Choice(SYMMETRIES),
        "Cones, seams and charts are mirror symmetric. auto: where the model is, to three thousandths of its size, if "
        "cones and seams become little more. x, y, z: about the plane of about that normal that fits best, to three "
        "hundredths.",
    )
    mirrored: str = option(
        "apart",
        Choice(MIRRORED),
        "overlap: both sides of a symmetric model lie on each other in the texture and share its texels.",
    )


@dataclass(frozen=True, kw_only=True)
class AtlasOptions:
    """Atlas."""

    charts: str = option(
        "atlas",
        Choice(CHARTS),
        "atlas: seams are moved, and cuts made where they must be, so that nothing overlaps. one: a single chart per "
        "component, as in the paper, which may overlap itself; PAPER and --paper take it.",
    )
    resolution: int = option(
        1024, Whole(2**16), "Texels along a side of the texture, by which padding counts."
    )
    padding: float = option(
        2.0,
        Number(),
        "Texels between charts, and between them and the border, at least; to a quarter of a side.",
    )
    tiles: int = option(1, Whole(1000), "Textures (UDIM tiles) to distribute charts over, all at one scale.")
    up: tuple[float, float, float] | None = option(
        None,
        Direction(),
        "What is up in the model is to be up in the texture; without, charts lie as they fill it best.",
    )


@dataclass(frozen=True, kw_only=True)
class InputOptions:
    """Input."""

    lengths: ArrayLike | None = option(
        None,
        Kind(),
        "A metric of one's own instead of the distances between vertices: (m, 3) side lengths of the triangles given, "
        "column i opposite corner i. For meshes given as arrays.",
        flag=False,
        one_mesh=True,
    )
    repair: bool = option(
        False,
        Flag(),
        "Drop, split and cut what makes the input no manifold, with a note, instead of refusing it. Commands do so "
        "unless told otherwise.",
        # A file's user can seldom mend it; whoever has arrays wants to know that they are no mesh.
        command_default=True,
    )
    strict: bool = option(
        False,
        Flag(),
        "Refuse triangles without area, which otherwise are opened by a tiny change of lengths; for commands, what "
        "is no manifold, too.",
    )
    progress: Progress | None = option(
        None, Kind(), "Called with what is being done and the fraction of the whole that is done.", flag=False
    )


@dataclass(frozen=True, kw_only=True)
class RunOptions(InputOptions):
    """Run."""

    solver: str = option(
        "auto",
        Choice(SOLVERS),
        "What solves the linear systems; auto is the fastest that is installed. amg iterates, for what fits no other.",
    )
    threads: int = option(
        THREADS,
        Whole(256),
        "Threads of PARDISO, which solves large systems; two stages at once at most are done by more than one. The "
        "last digits depend on it, so that it is the same on every machine unless told otherwise.",
    )


@dataclass(frozen=True, kw_only=True)
class FindOptions(InputOptions, ConeBounds, ConeNumber):
    """What `coneflat.find_cones` takes."""


@dataclass(frozen=True, kw_only=True)
class CurveOptions(InputOptions, ConeBounds):
    """What `coneflat.cone_curve` takes."""

    most: int = option(30, Most(), "The largest number of cones.")
