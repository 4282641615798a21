"""The options of a flattening: each is declared here, and here alone.

A field of a group below is an option: its name, type, default, kind with bounds, and what it means. The keywords of
`coneflat.flatten`, `find_cones` and `cone_curve`, the flags of the commands, what `coneflat batch` writes down, the
settings in the report and the tables in the documentation are made from it.
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
    MIN_CONE_ANGLE,
    MOST_CONES,
    MOST_PREFERENCE,
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
    strength,
    whole,
)  # fmt: skip

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

CONES = ("auto", "sparse", "greedy", "none")
#: From cones to a layout: this package's own, and the paper's.
METHODS = ("exact", "linear")
#: Which triangles of a flat metric are relaxed.
RELAXED = ("auto", "off", "whole")
CHARTS = ("atlas", "one")
BOUNDARIES = ("free", "lengths", "disk", "straight")
NO_CORNERS = "boundary names no corners; for a round boundary, say 'disk'"

# Radians: no triangulation has room for wider cones than this.
WIDEST_CONE = 1000 * math.pi

Cones = str | Mapping[int, float] | Mapping[int, float | None] | Iterable[int]

#: The published method: `flatten(mesh, **PAPER)`.
PAPER: Mapping[str, Any] = {
    "cones": "greedy",
    "max_cones": None,
    "method": "linear",
    "charts": "one",
}


#: Formats that flattened meshes are written in: the endings of their files.
FORMATS = ("obj", "ply", "glb", "npz")
#: Triangles up to which the page draws a mesh as it is; larger ones, which the browser would turn haltingly, are
#: thinned to so many.
MOST_TRIANGLES = 500_000
#: What the viewer's page can show first.
SHOWS = ("checker", "picture", "charts", "qc", "area", "curvature", "flat", "plain")


@dataclass(frozen=True)
class Declaration:
    """What is declared of an option.

    Attributes:
        kind: what values it takes.
        only: what alone has this choice: "sparse" for cones, "exact" for the method; or "".
        one_mesh: it names vertices of one mesh, so it fits no others.
        flag: the commands have it.
        command_default: what they take by default if it is not what Python takes; the reason stands beside it.
        name, type, default: of the field.
        group: what it is an option of, the first word of the docstring of its group.
        doc: what it means, for people at the command line and in Python alike: as in the docstring of its group.
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


def option(default: Any, kind: Kind, **more: Any) -> Any:
    """Return a field of a group, with its declaration."""
    return field(default=default, metadata={"declared": Declaration(kind, **more)})


@cache
def declarations(group: Any) -> dict[str, Declaration]:
    """Return the options of a group by name, its own before those of the groups that it is made of, in their order."""
    known = {each.name: each for each in fields(group)}
    found: dict[str, Declaration] = {}
    for base in group.__mro__:
        text = inspect.cleandoc(base.__doc__ or "")
        title = re.split(r"\W", text)[0]
        docs = dict(re.findall(r"^    (\w+): (.*(?:\n {8}.*)*)", text, re.MULTILINE))
        for name in inspect.get_annotations(base):
            if name in known and name not in found:
                of = known[name]
                doc = " ".join(docs.get(name, "").split())
                told = {"name": name, "group": title, "doc": doc, "type": of.type, "default": of.default}
                found[name] = replace(of.metadata["declared"], **told)
    return found


@dataclass(frozen=True, kw_only=True)
class ConeBounds:
    """Cones: of which angles, and where.

    Attributes:
        required_cones: Vertices that are cones in any case.
        forbidden_cones: Vertices that may not be cones.
        weights: Importance of each vertex, from which distortion keeps off: numbers, or a map of vertices to theirs,
            where others are 1; the name of a property in the file; or color, where grey vertices are 1, those of a pure
            colour 100.
        min_cone_angle: The sharpest cone: its angle, 2 pi less its curvature. Needles distort what is around them.
        max_cone_angle: The widest saddle: its angle, above 2 pi; none or inf for any. Wider ones have no room in
            triangles.
        positive_only: No cones of negative curvature, which are saddles.
    """

    required_cones: Iterable[int] = option((), Vertices(), only="sparse", one_mesh=True)
    forbidden_cones: Iterable[int] = option((), Vertices(), only="sparse", one_mesh=True)
    weights: ArrayLike | Mapping[int, float] | str | None = option(None, Weights(), only="sparse")
    min_cone_angle: float = option(MIN_CONE_ANGLE, ANGLE, only="sparse")
    max_cone_angle: float | None = option(MAX_CONE_ANGLE, ANGLE_OR_NONE, only="sparse")
    positive_only: bool = option(False, Flag(), only="sparse", flag=False)


@dataclass(frozen=True, kw_only=True)
class ConeNumber:
    """Cones: how many.

    Attributes:
        distortion: The area distortion allowed, the standard deviation of the log of the scale by area; less needs more
            cones.
        cone_count: So many cones per component, placed for the least area distortion, instead.
    """

    distortion: float = option(DISTORTION, POSITIVE, only="sparse")
    cone_count: int | None = option(None, COUNT, only="sparse")


@dataclass(frozen=True, kw_only=True)
class ConeQuanta:
    """Cones: of whole multiples.

    Attributes:
        quantise: Cones have curvatures that are multiples of this, pi/2 say, so that seams turn by such multiples.
        correct_handles: With quantised cones and the exact metric: make rotations along handles, and around holes where
            the boundary is free, multiples, too, by a map that is as little off conformal as can be.
    """

    quantise: float | None = option(None, ANGLE_OR_NONE, only="sparse")
    correct_handles: bool = option(False, Flag(), only="sparse", flag=False)


@dataclass(frozen=True, kw_only=True)
class ConeOptions(ConeNumber, ConeBounds, ConeQuanta):
    """Cones.

    Attributes:
        cones: How cones are found. sparse: the fewest for the distortion allowed. greedy: the paper's search, which
            takes three to six times as many. none: none, for bounded meshes and tori. Or vertices, each with its
            curvature or without: those without have the curvatures of the least area distortion. auto:
            sparse, but none where the boundary is prescribed, the corners of a polyhedron that has few, and greedy
            on closed surfaces with over 51 handles.
        max_cones: Searches stop at so many cones per component.
    """

    cones: Cones = option("auto", WordOrVertices(CONES, "cone", may_differ=True))
    max_cones: int | None = option(None, COUNT)


@dataclass(frozen=True, kw_only=True)
class MetricOptions:
    """Metric.

    Attributes:
        method: exact: no curvature error, and no flipped triangle. linear: the paper's linear system and least squares.
        boundary: Exact metric: free has the least area distortion. lengths is the same at the model's own scale, so
            that lengths on the boundary are kept. disk is round. straight has straight sides between corners that the
            search finds like cones. Or the corners of a polygon, vertices with curvatures, or all without for equal
            angles; components without one are free.
        relax: Exact metric: less distortion of triangles, with the same cones, curvatures and seams. auto: those that
            cones bend most, and three rings around them. whole: all. off: none, so that the map is discretely conformal
            everywhere.
        stretch: Exact metric: from angles, 0, to areas, 1, which is as near to isometric as the cones allow. More than
            0 moves all vertices, except on a boundary that is prescribed.
    """

    method: str = option("exact", Choice(METHODS))
    boundary: Cones = option("free", WordOrVertices(BOUNDARIES, "corner", NO_CORNERS), only="exact")
    relax: str = option("auto", Choice(RELAXED), only="exact")
    stretch: float = option(0.0, strength(1.0), only="exact")


@dataclass(frozen=True, kw_only=True)
class SeamOptions:
    """Seams.

    Attributes:
        seams: Edges that are cut in any case, pairs of vertices, or input: the seams of the file's own UVs, or both, as
            ("input", pairs). They act like a boundary. An edge that no other meets is not a cut.
        no_seams: Edges, pairs of vertices, that the first cut must not use, not for sharp edges or seams of the file
            either; or vertices: then the edges between two of them. No search puts a cone where no seam could reach.
            What is cut later so that nothing overlaps avoids these edges where it can.
        sharp_angle: Cut edges at which the surface bends by more, 40deg say: CAD parts open there. Other seams prefer
            sharp edges: the cost of an edge falls from its length where the surface bends by 20 degrees to a tenth at
            60.
        hide_seams: How much seams prefer what can hardly be seen, in deep folds and, with a direction up, below: at 1,
            it costs a tenth of its length.
        seam_weights: By how much seams are costlier at each vertex: numbers, or the name of a property in the file.
    """

    seams: ArrayLike | str | tuple[str, ArrayLike] | None = option(None, Edges(("input",)), one_mesh=True)
    no_seams: ArrayLike | None = option(None, VerticesOrEdges(), one_mesh=True)
    sharp_angle: float | None = option(None, ANGLE_OR_NONE)
    hide_seams: float = option(0.0, strength(MOST_PREFERENCE))
    seam_weights: ArrayLike | str | None = option(None, Weights())


@dataclass(frozen=True, kw_only=True)
class AtlasOptions:
    """Atlas.

    Attributes:
        charts: atlas: seams are moved, and cuts made where they must be, so that nothing overlaps. one: a single chart
            per component, as in the paper, which may overlap itself; PAPER and --paper take it.
        resolution: Texels along a side of the texture, by which padding counts.
        padding: Texels between charts, and between them and the border, at least; to a quarter of a side.
        tiles: Textures (UDIM tiles) to distribute charts over, all at one scale.
        up: What is up in the model is to be up in the texture; without, charts lie as they fill it best.
    """

    charts: str = option("atlas", Choice(CHARTS))
    resolution: int = option(RESOLUTION, whole(2**16))
    padding: float = option(PADDING, Number())
    tiles: int = option(1, whole(1000))
    up: tuple[float, float, float] | None = option(None, Direction())


@dataclass(frozen=True, kw_only=True)
class InputOptions:
    """Input.

    Attributes:
        lengths: A metric of one's own instead of the distances between vertices: (m, 3) side lengths of the triangles
            given, column i opposite corner i. For meshes given as arrays.
        repair: Drop, split and cut what makes the input no manifold, with a note, instead of refusing it. Commands do
            so unless told otherwise.
        strict: Refuse triangles without area, which otherwise are opened by a tiny change of lengths; for commands,
            what is not manifold, too.
        progress: Called with what is being done and the fraction of the whole that is done.
    """

    lengths: ArrayLike | None = option(None, Kind(), flag=False, one_mesh=True)
    # A file's user can seldom mend it; whoever has arrays wants to know that they are not a mesh.
    repair: bool = option(False, Flag(), command_default=True)
    strict: bool = option(False, Flag())
    progress: Progress | None = option(None, Kind(), flag=False)


@dataclass(frozen=True, kw_only=True)
class RunOptions(InputOptions):
    """Input, and how it is worked on.

    Attributes:
        threads: Threads of PARDISO, which solves large systems; two stages at once at most are done by more than one.
            The last digits depend on it, so that it is the same on every machine unless told otherwise.
    """

    threads: int = option(THREADS, whole(256))


@dataclass(frozen=True, kw_only=True)
class FindOptions(ConeNumber, ConeBounds, InputOptions):
    """What `coneflat.find_cones` takes."""


@dataclass(frozen=True, kw_only=True)
class CurveOptions(ConeBounds, InputOptions):
    """What `coneflat.cone_curve` takes.

    Attributes:
        most: The largest number of cones.
    """

    most: int = option(MOST_CONES, whole())
