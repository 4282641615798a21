"""Declarations of all options of a flattening.

A field of a group below is an option: its name, type, default, kind with bounds, and help text. The keywords of
`coneflat.flatten`, `find_cones` and `cone_curve`, the flags of the commands, the records of `coneflat batch`, the
settings in the report and the tables in the documentation are generated from it.
"""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cache
from typing import TYPE_CHECKING, Any

from ..base.defaults import (
    DISTORTION,
    MAX_CONE_ANGLE,
    MAX_CONES,
    MAX_PREFERENCE,
    MIN_CONE_ANGLE,
    PADDING,
    RESOLUTION,
)
from ..base.progress import Progress
from ..base.threads import THREADS
from .kinds import (
    ANGLE,
    ANGLE_OR_NONE,
    COUNT,
    POSITIVE,
    Choice,
    Direction,
    Edges,
    Flag,
    Kind,
    Number,
    Vertices,
    VerticesOrEdges,
    Weights,
    WordOrVertices,
    integer,
    strength,
)  # fmt: skip

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

CONES = ("auto", "sparse", "greedy", "none")
#: Rarely used options, which helps and panels list at the end.
RARE = (
    "max_cones", "required_cones", "forbidden_cones", "weights", "min_cone_angle", "max_cone_angle", "quantise",
    "relax", "no_seams", "hide_seams", "seam_weights", "tiles", "block_size",
    "threads",
)  # fmt: skip
NO_CORNERS = "boundary must have at least one corner; for a round boundary use 'disk'"

# Radians. A larger bound has no effect on any triangulation.
WIDEST_CONE = 1000 * math.pi

Cones = str | Mapping[int, float] | Mapping[int, float | None] | Iterable[int]

#: The published method: `flatten(mesh, **PAPER)`.
PAPER: Mapping[str, Any] = {"cones": "greedy", "max_cones": None, "method": "linear", "charts": "one"}


#: Largest number of triangles that the page draws. Larger meshes, which a browser rotates slowly, are simplified.
MAX_SHOWN_TRIANGLES = 500_000
#: What the page of the viewer can show first.
SHOWS = ("checker", "picture", "charts", "qc", "area", "strain", "faults", "curvature", "flat", "plain")


@dataclass(frozen=True)
class Declaration:
    """The declaration of an option.

    Attributes:
        kind: the values it takes.
        only: the method that alone supports it: "sparse" for cones, "exact" for the metric; or "".
        one_mesh: it contains vertex indices, so its value applies to one mesh only.
        flag: the commands have a flag for it.
        command_default: the default of the commands if it differs from that in Python; a comment gives the reason.
        name, type, default: those of the field.
        group: the group of the option: the first word of the docstring of its class.
        doc: help text for the command line and for Python, from the docstring of its class.
    """

    kind: Kind
    only: str = ""
    one_mesh: bool = False
    flag: bool = True
    command_default: Any = None
    name: str = ""
    type: Any = None
    default: Any = None
    group: str = ""
    doc: str = ""


def option(default: Any, kind: Kind, **properties: Any) -> Any:
    """Return a dataclass field with the declaration of an option."""
    return field(default=default, metadata={"declared": Declaration(kind, **properties)})


@cache
def declarations(group: Any) -> dict[str, Declaration]:
    """Return the options of a group by name: its own fields, then those of its base classes, in their order."""
    fields_by_name = {option_field.name: option_field for option_field in fields(group)}
    declared: dict[str, Declaration] = {}
    for base in group.__mro__:
        text = inspect.cleandoc(base.__doc__ or "")
        title = re.split(r"\W", text)[0]
        docs = dict(re.findall(r"^    (\w+): (.*(?:\n {8}.*)*)", text, re.MULTILINE))
        for name in inspect.get_annotations(base):
            if name in fields_by_name and name not in declared:
                declared_field = fields_by_name[name]
                doc = " ".join(docs.get(name, "").split())
                data = {
                    "name": name,
                    "group": title,
                    "doc": doc,
                    "type": declared_field.type,
                    "default": declared_field.default,
                }
                declared[name] = replace(declared_field.metadata["declared"], **data)
    return declared


@dataclass(frozen=True, kw_only=True)
class ConeBounds:
    """Cones: bounds of their angles and positions.

    Attributes:
        required_cones: Vertices that must be cones.
        forbidden_cones: Vertices that must not be cones.
        weights: Importance of each vertex; important regions get less area distortion. An array with one number per
            vertex; a map from vertex to number, 1 for the others; the name of a vertex property in the file; or color,
            which gives 1 to grey vertices and 100 to vertices of a pure colour.
        min_cone_angle: Smallest cone angle (2 pi minus the curvature). Sharper cones distort the triangles around them.
        max_cone_angle: Largest cone angle, above 2 pi; none or inf: no bound. Larger angles rarely fit the
            triangles around a cone.
        positive_only: No cones of negative curvature (saddles).
    """

    required_cones: Iterable[int] = option((), Vertices(), only="sparse", one_mesh=True)
    forbidden_cones: Iterable[int] = option((), Vertices(), only="sparse", one_mesh=True)
    weights: ArrayLike | Mapping[int, float] | str | None = option(None, Weights(), only="sparse")
    min_cone_angle: float = option(MIN_CONE_ANGLE, ANGLE, only="sparse")
    max_cone_angle: float | None = option(MAX_CONE_ANGLE, ANGLE_OR_NONE, only="sparse")
    positive_only: bool = option(False, Flag(), only="sparse", flag=False)


@dataclass(frozen=True, kw_only=True)
class ConeNumber:
    """Cones: their number.

    Attributes:
        distortion: Largest area distortion allowed: the standard deviation of the log conformal factor,
            weighted by area. A smaller value needs more cones.
        cone_count: Number of cones per component, instead of a distortion. They are placed for the least area
            distortion.
    """

    distortion: float = option(DISTORTION, POSITIVE, only="sparse")
    cone_count: int | None = option(None, COUNT, only="sparse")


@dataclass(frozen=True, kw_only=True)
class ConeQuanta:
    """Cones: quantised curvatures (integer cones).

    Attributes:
        quantise: Cone curvatures are multiples of this angle, for example pi/2. Rotations across seams are then
            multiples of it, too.
        correct_handles: With quantised cones and the exact metric: make the holonomy along handles, and around holes
            where the boundary is free, a multiple, too. The map is then not conformal, but as close to it as possible.
    """

    quantise: float | None = option(None, ANGLE_OR_NONE, only="sparse")
    correct_handles: bool = option(False, Flag(), only="sparse", flag=False)


@dataclass(frozen=True, kw_only=True)
class ConeOptions(ConeNumber, ConeBounds, ConeQuanta):
    """Cones.

    Attributes:
        cones: How cones are found. sparse: search for the fewest cones with the allowed distortion. greedy: the search
            of the paper, which needs three to six times as many cones. none: no cones, for meshes with boundary and
            tori. Or a list of vertices, each with or without a curvature; missing curvatures are chosen for the least
            area distortion. auto: sparse, except that a prescribed boundary gets no cones, a polyhedron opens at
            its corners where that is better, and closed surfaces with over 51 handles use greedy.
        max_cones: Largest number of cones per component, at which searches stop.
    """

    cones: Cones = option("auto", WordOrVertices(CONES, "cone", may_differ=True))
    max_cones: int | None = option(None, COUNT)


@dataclass(frozen=True, kw_only=True)
class MetricOptions:
    """Metric.

    Attributes:
        method: exact: no curvature error; flipped triangles are untangled, and those that remain are reported with
            their number. linear: the linear system and least squares layout of the paper.
        boundary: Shape of the boundary, with the exact metric. free: the least area distortion. lengths: preserve the
            edge lengths of the boundary. disk: a circle. straight: straight sides between corners that the search
            finds together with the cones. Or the corners of a polygon: vertices with curvatures, or all without for
            equal angles; components without a corner have a free boundary.
        relax: Reduce the distortion of triangles and preserve cones, curvatures and seams, with the exact metric.
            auto: relax the triangles that cones distort most, and three rings around them. whole: all triangles. off:
            none, so that the map is discretely conformal everywhere.
        stretch: Trade-off between angles (0) and areas (1), with the exact metric. At 1 the map is as close to
            isometric as the cones allow. Above 0 all vertices move, except on a prescribed boundary.
    """

    method: str = option("exact", Choice(("exact", "linear")))
    boundary: Cones = option(
        "free", WordOrVertices(("free", "lengths", "disk", "straight"), "corner", NO_CORNERS), only="exact"
    )
    relax: str = option("auto", Choice(("auto", "off", "whole")), only="exact")
    stretch: float = option(0.0, strength(1.0), only="exact")


@dataclass(frozen=True, kw_only=True)
class SeamOptions:
    """Seams.

    Attributes:
        seams: Edges that must be cut, as pairs of vertices; or input, for the seams of the UVs in the file. In Python,
            ("input", pairs) combines both. Marked edges act as boundaries. A single edge without a neighbouring seam is
            not cut.
        no_seams: Edges that must not be cut, as pairs of vertices; or vertices, for all edges between two of them.
            This also excludes sharp edges and seams of the file. Cones are placed only where seams can reach them.
            Cuts that are added later to remove overlaps avoid these edges if possible.
        sharp_angle: Cut edges with a larger dihedral angle, for example 40deg for CAD parts. Other seams prefer
            sharp edges: the cost of an edge is its length up to 20 degrees, and falls to a tenth of it at 60 degrees.
        hide_seams: Strength of the preference for seams in places that are hard to see, in deep folds and, if up is
            given, on the underside. At 1, hidden edges cost a tenth of their length.
        seam_weights: Factor of the cost of seams at each vertex: one number per vertex, or the name of a vertex
            property in the file.
    """

    seams: ArrayLike | str | tuple[str, ArrayLike] | None = option(None, Edges(("input",)), one_mesh=True)
    no_seams: ArrayLike | None = option(None, VerticesOrEdges(), one_mesh=True)
    sharp_angle: float | None = option(None, ANGLE_OR_NONE)
    hide_seams: float = option(0.0, strength(MAX_PREFERENCE))
    seam_weights: ArrayLike | str | None = option(None, Weights())


@dataclass(frozen=True, kw_only=True)
class AtlasOptions:
    """Atlas.

    Attributes:
        charts: atlas: move seams and add cuts until no triangles overlap. one: a single chart per component, as in the
            paper, which may overlap itself; PAPER and --paper use it.
        resolution: Texels along a side of the texture. Padding is measured in these.
        padding: Smallest distance between charts, and between charts and the border, in texels; at most a quarter of a
            side.
        tiles: Number of textures (UDIM tiles) over which charts are distributed, all at one scale.
        block_size: Texels along a side of a block; the box of each chart begins at a corner of a block. 4 suits
            textures whose compression has blocks of 4 by 4 texels, 1 allows any place.
        up: Upward direction of the model; charts are rotated so that it points up in the texture. Without it, charts
            are rotated to fill the texture best.
    """

    charts: str = option("atlas", Choice(("atlas", "one")))
    resolution: int = option(RESOLUTION, integer(2**16))
    padding: float = option(PADDING, Number())
    tiles: int = option(1, integer(1000))
    block_size: int = option(1, integer(256))
    up: tuple[float, float, float] | None = option(None, Direction())


@dataclass(frozen=True, kw_only=True)
class InputOptions:
    """Input.

    Attributes:
        lengths: Metric to use instead of the distances between vertices: (m, 3) side lengths of the triangles, column
            i opposite corner i. For meshes given as arrays only.
        repair: Remove, split or cut what makes the input not a manifold, and add a note, instead of raising an error.
            This is the default of the commands.
        strict: Raise an error for triangles without area, which are otherwise opened by a tiny change of lengths; in
            commands, also for meshes that are not manifold.
        progress: Function that is called with the name of the current stage and the completed fraction of all work.
    """

    lengths: ArrayLike | None = option(None, Kind(), flag=False, one_mesh=True)
    # The user of a file can rarely repair it; a user of arrays should be notified that they are not a mesh.
    repair: bool = option(False, Flag(), command_default=True)
    strict: bool = option(False, Flag())
    progress: Progress | None = option(None, Kind(), flag=False)


@dataclass(frozen=True, kw_only=True)
class RunOptions(InputOptions):
    """Input and computation.

    Attributes:
        threads: Number of threads of PARDISO, which solves large linear systems. With more than one, the
            search for cones may also use a second one. The last digits of results depend on it, so the default is the
            same on every machine.
    """

    threads: int = option(THREADS, integer(256))


@dataclass(frozen=True, kw_only=True)
class FindOptions(ConeNumber, ConeBounds, InputOptions):
    """Options of `coneflat.find_cones`."""


@dataclass(frozen=True, kw_only=True)
class CurveOptions(ConeBounds, InputOptions):
    """Options of `coneflat.cone_curve`.

    Attributes:
        most: Largest number of cones.
    """

    most: int = option(MAX_CONES, integer())
