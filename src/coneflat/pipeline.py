"""Flattening: cones, target curvatures, scaling, cutting, layout (Section 4 of the paper)."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ._arrays import FloatArray, IntArray
from .atlas.injective import without_overlaps
from .cones import ConeSolution
from .cones.choose import DEARER, Surface, Turned, choose_cones, has_many_handles, pursues
from .errors import CurvatureError, MetricError, SeamError
from .flat import LaidOut
from .flat.exact.flatten import ExactFlatMetric
from .flat.methods import find_metric
from .geometry.handles import open_turning
from .geometry.operators import area_distortion, weighted_areas
from .input.components import Component, Prepared, prepare, seam_costs
from .input.constraints import Constraints
from .mesh import TriangleMesh
from .options import UNFOLDED, Boundary, Cones, Options
from .progress import Progress, Stages
from .quality.distortion import measure
from .quality.rotations import measure_rotations
from .result.assemble import assemble
from .result.flattening import Flattening
from .seams import cut_open, find_seams
from .solver import solving
from .text import plural
from .threads import meanwhile, one_blas_thread

# Searches for cones at most, if some of them are too wide for the triangles around.
SEARCHES = 4
# Radians by which a cone is off then: a full turn, less what rounding and untangled neighbours make.
UNHELD = 1.0
# A log scale that varies by less is constant.
FLAT = 1e-9
# The distortion asked for may be missed by so much, relatively, without a word.
NARROWLY = 1e-3


def flatten(
    mesh: Any,
    faces: ArrayLike | None = None,
    *,
    cones: Cones = "auto",
    distortion: float = 0.2,
    cone_count: int | None = None,
    max_cones: int | None = None,
    min_cone_angle: float = math.pi / 2,
    max_cone_angle: float | None = 4 * math.pi,
    positive_only: bool = False,
    weights: ArrayLike | str | None = None,
    required_cones: Iterable[int] = (),
    forbidden_cones: Iterable[int] = (),
    allowed_cones: Iterable[int] | None = None,
    quantum: float | None = None,
    correct_handles: bool = False,
    epsilon: float = 1.0,
    method: str = "exact",
    length_rule: str = "integral",
    at_cones: str = "auto",
    boundary: Boundary = "free",
    best_effort: bool = False,
    refine: bool = False,
    repair: bool = False,
    strict: bool = False,
    solver: str = "auto",
    charts: str = "one",
    seams: ArrayLike | str | None = None,
    sharp_angle: float | None = None,
    forbidden_seams: ArrayLike | None = None,
    creases: float = 0.0,
    hide_seams: float = 0.0,
    seam_weights: ArrayLike | str | None = None,
    resolution: int = 1024,
    padding: float = 2.0,
    tiles: int = 1,
    up: tuple[float, float, float] | None = None,
    progress: Progress | None = None,
) -> Flattening:
    """Flatten a triangle mesh of any topology conformally, one disk per connected component.

    Args:
        mesh: vertices (n, 3) if `faces` is given; else a path, a `MeshFile`, a pair (vertices, faces), or
            a mesh of trimesh, meshio or pyvista.
        faces: (m, 3) vertex indices from 0.
        cones: "pursuit" finds the fewest cones for the area distortion allowed, "greedy" is the paper's search,
            "none" uses none (bounded meshes and tori); vertices get the curvatures that minimise scale
            distortion; a map from vertex to curvature in radians is taken as it is. "auto" is "pursuit",
            but "none" for components with a prescribed boundary, the corners of polyhedra that have few, which
            so unfold without distortion, and "greedy" where handles alone need over a hundred cones. Vertices are
            those of the input.
        distortion: of the pursuit: the area distortion E allowed in the linear model, the standard deviation of
            the log scale by area.
        cone_count: of the pursuit: a number of cones per component, to be placed for the least distortion, instead.
        max_cones: both searches stop at this many cones per component; None for no limit.
        min_cone_angle, max_cone_angle: of the pursuit: bounds of the cones' angles, 2 pi - curvature, radians;
            None for no upper bound.
        positive_only: of the pursuit: no cones of negative curvature.
        weights: of the pursuit: (n,) importance of each input vertex, 0 and up; distortion keeps off what weighs
            more. Or the name of a property in the file, or "color": 1 for grey vertices, 100 for painted ones.
        required_cones, forbidden_cones, allowed_cones: of the pursuit: vertices that are cones in any case, that may
            not be, that alone may be.
        quantum: of the pursuit: cones have curvatures that are multiples of this, pi / 2 say, radians. Then
            the two sides of a seam are turned by such a multiple, but for what handles leave.
        correct_handles: of quanta and the exact metric: change the metric, as little as can be, so that
            rotations along handles are multiples, too; it is then not quite conformal.
        epsilon: the greedy search stops when log scale factors differ by at most this.
        method: "exact" has no curvature error and no flipped triangle, "linear" is the paper's. For comparison:
            "circle-patterns" (Kharevych et al. 2006), "ricci" (Jin et al. 2007), "linear-abf" (Zayer et al. 2007),
            "abf++" (Sheffer et al. 2005), "bff" (Sawhney and Crane 2017), and, without cones on what was cut open,
            "lscm" (Levy et al. 2002) and "spectral" (Mullen et al. 2008). "linear-abf/free" and "abf++/free" prescribe
            no cones either, and "circle-patterns/fixed" flips no edges.
        length_rule: of the linear metric: "integral" scales an edge by the mean of exp(phi) along it, "mean"
            by exp of the mean.
        at_cones: of the exact metric: "scale" prescribes phi = 0 at the cones and their curvatures come out,
            "curvature" prescribes those of the search; "auto" is "scale" for cones "greedy" and at given
            positions, unless the boundary is prescribed, and else "curvature".
        boundary: of the exact metric: "free" has the least area distortion (phi = 0 there), "lengths" is the
            same at the model's own scale, so that boundary lengths are kept, "disk" makes it round, "straight" has
            straight sides between corners that the pursuit finds like cones; vertices
            make it a polygon with these corners and straight sides between, all of one angle, and a map
            from vertex to curvature in radians one with these.
        best_effort: return a metric that did not converge to its tolerance, instead of refusing it.
        refine: of the exact metric: return the mesh cut along the edges of the flat triangulation, on which the
            map has no inverted triangle by construction, instead of the input's own triangles.
        repair: drop, split and cut what makes the input no manifold, instead of refusing it.
        strict: refuse triangles without area, instead of opening them by a tiny perturbation.
        solver: what factorizes: "pardiso", "cholespy", "scipy", or "amg", which iterates and
            needs little memory; "auto" takes the fastest that is installed.
        charts: "one" lays every component out as a single disk, which may overlap itself, as the paper does; "atlas"
            moves its seams, and cuts where it must, so that nothing overlaps.
        seams: edges to be cut in any case: (k, 2) pairs of vertices, or "input" for the seams of the file's own UVs.
            They act like a boundary; where they close curves, the mesh falls into several charts. A single edge
            inside, which no other meets, has the same ends on both sides: it is no cut.
        sharp_angle: edges whose faces' normals differ by more than this are cut, too, radians.
        forbidden_seams: (k, 2) pairs of vertices between which the first cut must not run, not for sharp edges or
            seams of the file either; what is cut later so that nothing overlaps avoids them where it can.
        creases: how much seams prefer sharp edges, 0 to 10: at 1, one of 60 degrees and more costs a tenth of its
            length.
        hide_seams: how much they prefer what can hardly be seen, 0 to 10: at 1, it costs a tenth of its length.
        seam_weights: (n,) by which seams are dearer at each vertex, or the name of a property, as for `weights`.
        resolution: texels along a side of the texture, for which there are
        padding: texels between charts, and between them and the border, at least.
        tiles: number of textures (UDIM) to distribute charts over.
        up: direction of the model that is to be up in the texture; without one, charts lie as they fill it best.
        progress: called with the name of each stage and the fraction of triangles done.

    Raises:
        MeshError: the mesh cannot be flattened; see `coneflat.errors` for its kinds.
        CurvatureError: no metric has the curvatures asked for.
        OptionError: an option makes no sense.
        SeamError: every set of seams needs forbidden edges.
        MetricError: the computation found no finite result.
    """
    options = Options(
        cones=cones,
        distortion=distortion,
        cone_count=cone_count,
        max_cones=max_cones,
        min_cone_angle=min_cone_angle,
        max_cone_angle=max_cone_angle,
        positive_only=positive_only,
        weights=weights,
        required_cones=required_cones,
        forbidden_cones=forbidden_cones,
        allowed_cones=allowed_cones,
        quantum=quantum,
        correct_handles=correct_handles,
        epsilon=epsilon,
        method=method,
        length_rule=length_rule,
        at_cones=at_cones,
        boundary=boundary,
        best_effort=best_effort,
        refine=refine,
        repair=repair,
        strict=strict,
        solver=solver,
        charts=charts,
        seams=seams,
        sharp_angle=sharp_angle,
        forbidden_seams=forbidden_seams,
        creases=creases,
        hide_seams=hide_seams,
        seam_weights=seam_weights,
        resolution=resolution,
        padding=padding,
        tiles=tiles,
        up=up,
    )
    stages = Stages(progress)
    with stages("check"):
        prepared = prepare(mesh, faces, options)
    with one_blas_thread(), solving(options.solver) as solvers:
        pieces = _flatten_components(prepared, options, stages)
    return replace(assemble(prepared, pieces, options, stages), solvers=tuple(solvers.used))


def _flatten_components(prepared: Prepared, options: Options, stages: Stages) -> list[LaidOut]:
    pieces = []
    for part in prepared.components:
        stages.share = len(part.faces) / len(prepared.checked.mesh.faces)
        try:
            pieces.append(flatten_component(part, options, stages))
        except (CurvatureError, MetricError, SeamError) as error:
            if len(prepared.components) == 1:
                raise
            where = f"in the component of vertex {part.constraints.names[0]} ({len(part.faces):,} triangles)"
            raise type(error)(f"{where}: {error}") from error
        stages.end_part()
    return pieces


def flatten_component(part: Component, options: Options, stages: Stages) -> LaidOut:
    """Flatten a connected mesh to one disk."""
    with stages("cones", 0.1):
        surface = Surface.of(part.mesh, part.lengths)
    laid_out = _flatten_once(surface, part, options, stages)
    if pursues(part.mesh, options) and options.method in UNFOLDED:
        laid_out = _with_held_cones(laid_out, surface, part, options, stages)
    if options.charts == "atlas":
        with stages("atlas", 1.0):
            laid_out = without_overlaps(laid_out, part, options)
    notes = _missed_distortion(laid_out, part, options)
    if has_many_handles(part.mesh, options):
        notes += (
            f"A surface with {part.mesh.genus():,} handles needs so many cones that the greedy search placed them.",
        )
    if options.method in UNFOLDED:
        notes += shortfalls(laid_out, part.constraints.names)
    return replace(laid_out, notes=laid_out.notes + notes)


def _with_held_cones(
    laid_out: LaidOut, surface: Surface, part: Component, options: Options, stages: Stages
) -> LaidOut:
    """Return a layout with other cones, if triangles around some of these have no room for their angles.

    Each search forbids the cones that those before could not hold. It may find more of them before it finds none, so
    the layout with the fewest is taken.
    """
    best, fewest = laid_out, len(unheld_cones(laid_out))
    for _ in range(SEARCHES - 1):
        if not fewest:
            break
        part = replace(part, constraints=part.constraints.without(unheld_cones(laid_out)))
        laid_out = _flatten_once(surface, part, options, stages)
        if len(unheld_cones(laid_out)) < fewest:
            best, fewest = laid_out, len(unheld_cones(laid_out))
    return best


def _missed_distortion(laid_out: LaidOut, part: Component, options: Options) -> tuple[str, ...]:
    """Return that the distortion asked for was not reached, if so."""
    reached = laid_out.statistics.area_distortion_linear
    if not pursues(part.mesh, options):
        return ()
    if options.cone_count is not None:
        found = len(laid_out.cones)
        if found == options.cone_count:
            return ()
        return (
            f"{plural(found, 'cone')} instead of the {options.cone_count:,} asked for: more of them, within the bounds "
            "given, would gain nothing or have no vertex inside to be at.",
        )
    if reached <= options.distortion * (1 + NARROWLY):
        return ()
    why = "no better was found within the bounds given"
    if options.quantum is not None and part.mesh.genus() and reached <= options.distortion * DEARER:
        why = "cones were moved a little for the sake of the rotations along handles"
    return (
        f"The area distortion is {reached:.3g} with {plural(len(laid_out.cones), 'cone')}, above the "
        f"{options.distortion:g} allowed: {why}.",
    )


def shortfalls(laid_out: LaidOut, names: IntArray) -> tuple[str, ...]:
    """Return what the layout does not keep of the metric, one sentence each."""
    notes = []
    unheld = unheld_cones(laid_out)
    if len(unheld):
        angle = 2 - laid_out.target[unheld[0]] / np.pi
        notes.append(
            f"{plural(len(unheld), 'cone')} too wide for the triangles around: that at vertex {names[unheld[0]]} has "
            f"an angle of {angle:.3g} pi. Choose others, or refine (--refine)."
        )
    return tuple(notes)


def unheld_cones(laid_out: LaidOut) -> IntArray:
    """Return the cones that the triangles around them cannot make room for, each having an angle below pi."""
    error = laid_out.target - laid_out.curvature
    return laid_out.cones[np.abs(error[laid_out.cones]) > UNHELD]


def _flatten_once(surface: Surface, part: Component, options: Options, stages: Stages) -> LaidOut:
    with stages("cones", 0.4):
        solution = choose_cones(
            surface, part.constraints, options, stages, _turning_meter(surface, part.constraints, options)
        )
    laid_out = _lay_out(surface, part, solution, replace(options, correct_handles=False), stages)
    if not options.correct_handles or options.quantum is None or not part.mesh.genus():
        return laid_out
    corrected = _lay_out(surface, part, solution, options, stages)
    cost = _cost_of_correction(laid_out, corrected, options.quantum)
    return replace(corrected, notes=(*corrected.notes, cost))


def _turning_meter(surface: Surface, constraints: Constraints, options: Options) -> Turned | None:
    """Return what tells by how much loops across handles turn with given cones; None where nobody asks."""
    if options.quantum is None or options.method != "exact" or not surface.mesh.genus():
        return None
    turning, plain = open_turning(surface.mesh), replace(options, correct_handles=False, best_effort=True)

    def turned(solution: ConeSolution) -> FloatArray:
        metric = find_metric(surface, solution, constraints, plain)
        return turning.of_flat(metric.straight()) if isinstance(metric, ExactFlatMetric) else np.empty(0)

    return turned


def _cost_of_correction(before: LaidOut, after: LaidOut, quantum: float) -> str:
    qc = [measure(one.mesh, one.points[one.corners]).qc_mean for one in (before, after)]
    off = np.abs(measure_rotations(before.mesh, before.points[before.corners], quantum).handles).max(
        initial=0.0
    )
    return (
        f"Rotations along handles were off by up to {off:.2g} rad; making them whole changed the mean QC distortion "
        f"from {qc[0]:.5f} to {qc[1]:.5f}."
    )


def _lay_out(
    surface: Surface, part: Component, solution: ConeSolution, options: Options, stages: Stages
) -> LaidOut:
    """Scale, cut and lay out a connected mesh with given cones."""
    mesh = part.mesh
    # The cut depends on the cones alone.
    with meanwhile(partial(_cut, part, solution, options), len(mesh.faces)) as cutting:
        with stages("metric", 0.75):
            metric = find_metric(surface, solution, part.constraints, options)
        with stages("cut", 0.85):
            disk, seams = cutting.result()

    with stages("layout", 0.95):
        laid_out = metric.lay_out(disk, seams)
        linear, reached = (
            area_distortion(phi, weighted_areas(surface.areas, part.constraints.weights))
            for phi in (solution.log_scale, laid_out.log_scale[: len(mesh.vertices)])
        )
        statistics = replace(laid_out.statistics, area_distortion_linear=linear, area_distortion=reached)
        return replace(laid_out, statistics=statistics)


def _cut(part: Component, solution: ConeSolution, options: Options) -> tuple[TriangleMesh, IntArray]:
    """Return a connected mesh cut open to a disk with the cones on its border, and the edges that were cut."""
    # What unfolds without distortion is a polyhedron, and opens along its edges.
    is_polyhedron = np.ptp(solution.log_scale) < FLAT
    marked = replace(options, creases=1.0) if is_polyhedron and not options.creases else options
    costs, avoided, forbidden = seam_costs(part, marked)
    seams = find_seams(part.mesh, solution.cones, costs, avoided, forbidden=np.flatnonzero(forbidden))
    return cut_open(part.mesh, seams).mesh, seams
