"""Independent checks of the guarantees of a flattening on the arrays of the result."""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np

from . import plane
from .outcome import Outcome
from .topology import Topology

TURN = 2 * np.pi
#: Radians that angles may be off, and, relatively, the sides of a seam; beside what rounding of the points makes.
ANGLE, SIDES = 1e-6, 1e-8
#: The latter where triangles had to be opened by a hair, and at the seams that a note names; above it another note says
#: by how much sides differ.
LOOSE_SIDES = 1e-6
#: The notes that name seams with unequal sides: those near vertices; so many marked ones, and their largest error.
NO_ROOM = re.compile(
    r".* could not be untangled .* next to (vertex .*): .* the sides of seams near them are unequal"
)
NOT_KEPT = re.compile(
    r"([\d,]+) edges? of [\d,]+ on the boundary or on marked seams could not keep their lengths, "
    r"with relative errors of up to (\S+):"
)
#: Rings of triangles around those vertices in which points may have moved; an error of both sides, rounded in the note.
NO_ROOM_RINGS, BOTH_SIDES = 8, 2.1
#: A round boundary is found in rounds, each of which changes curvatures by less than the one before.
ROUND = 0.02
#: Largest mesh whose overlaps are also computed by all pairs.
ALL_PAIRS = 700
EPS = np.finfo(np.float64).eps
#: The sentence that the notes must contain for each unmet guarantee.
SENTENCES = {
    "flipped": r"There (is|are) [\d,]+ flipped triangles? .*in the plane",
    "collapsed": r"There (is|are) ([\d,]+ flipped triangles? and )?[\d,]+ degenerate triangles? in the plane",
    "overlap": r"[\d,]+ pairs? of triangles overlaps? in the atlas",
    "angles": r"Around [\d,]+ (vertex|vertices) the angle sum differs from its target",
    "sides": r"The two sides of seams differ in length|.* no seam or cone is exact",
    "lengths": r"Lengths along the boundary are not preserved",
    "round": r"The boundary is not a circle",
    "needles": r"[\d,]+ triangles? with a QC distortion above 1000|There (is|are) .*(flipped|degenerate) triangle",
    "rotations": r"Seam rotations are .* rad off multiples of [\d.e+-]+ rad",
    "area": r"The triangles of (all components|a component) have an area distortion",
    "cone count": r"[\d,]+ cones? instead of the [\d,]+ asked for",
}


class Trial:
    """A result to check: its arrays and the options."""

    def __init__(
        self, outcome: Outcome, result: Any, options: dict[str, Any], vertices: Any, faces: Any
    ) -> None:
        self.outcome, self.result, self.options = outcome, result, options
        self.mesh = np.asarray(vertices, dtype=np.float64), np.asarray(faces)
        self.corners = result.uv[result.uv_faces]
        self.topology = Topology.of(result.faces, len(result.vertices))
        self.method = options.get("method", "exact")
        self.boundary = options.get("boundary", "free")
        self.is_marked = any(options.get(name) is not None for name in ("seams", "sharp_angle")) or any(
            note.startswith("Edges above") for note in result.notes
        )
        self.sides = plane.side_lengths(self.corners)

    def breach(self, cause: str, details: object) -> None:
        """Add a breach."""
        self.outcome.breach(cause, f"{details}; notes {list(self.result.notes)}")

    def broken(self, promise: str, cause: str, details: object) -> None:
        """Record an unmet guarantee, which is a breach unless a note reports it."""
        if any(re.match(SENTENCES[promise], note) for note in self.result.notes):
            self.outcome.excuse(cause)
        else:
            self.breach(cause, details)


def check(outcome: Outcome, result: Any, options: dict[str, Any], vertices: Any, faces: Any) -> None:
    """Check a result against all guarantees, and add breaches to the outcome."""
    if not _sound(outcome, result):
        return
    trial = Trial(outcome, result, options, vertices, faces)
    _check_origin(trial)
    _check_place(trial)
    _check_orientation(trial)
    _check_needles(trial)
    _check_overlap(trial)
    _check_angles(trial)
    _check_sides(trial)
    _check_boundary(trial)
    _check_rotations(trial)
    _check_cones(trial)
    _check_area(trial)
    _check_report(trial)


def _sound(outcome: Outcome, result: Any) -> bool:
    """Return whether arrays have the shapes and ranges that further checks need."""
    for name, array in (("faces", result.faces), ("uv_faces", result.uv_faces)):
        bound = len(result.vertices) if name == "faces" else len(result.uv)
        if array.shape != (len(result.faces), 3) or array.min() < 0 or array.max() >= bound:
            outcome.breach(f"arrays: {name} out of range", array.shape)
            return False
    if not np.isfinite(result.uv).all():
        outcome.breach("arrays: uv not finite", f"{(~np.isfinite(result.uv)).sum()} of {result.uv.size}")
        return False
    if not np.isfinite(result.curvatures).all() or len(result.curvatures) != len(result.cones):
        outcome.breach("arrays: curvatures not finite", result.curvatures)
    return True


def _check_origin(trial: Trial) -> None:
    """Check that vertices and faces are those of the input."""
    result, (vertices, faces) = trial.result, trial.mesh
    if not np.array_equal(result.vertices, vertices[result.vertex_origin], equal_nan=True):
        trial.outcome.breach("origin: vertices are not the input's", "")
    named = np.sort(result.vertex_origin[result.faces], axis=1)
    if not np.array_equal(named, np.sort(faces[result.face_origin], axis=1)):
        trial.outcome.breach("origin: faces are not the input's", "")
    is_proper = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    if len(np.setdiff1d(np.flatnonzero(is_proper), result.face_origin)):
        trial.breach("origin: a face of the input is lost", f"{len(result.faces)} of {len(faces)}")
    if len(np.unique(result.face_origin)) < len(result.faces):
        trial.outcome.breach("origin: a face of the input twice", "")
    if (trial.topology.count > 2).any():
        trial.outcome.breach("origin: the result is not manifold", "")


def _check_place(trial: Trial) -> None:
    """Check that points are in the unit square, or in the tiles."""
    uv, tiles = trial.result.uv, int(trial.options.get("tiles", 1))
    low, high = uv.min(axis=0), uv.max(axis=0)
    limits = np.array([min(tiles, 10), (tiles + 9) // 10])
    if (low < 0).any() or (high > limits).any():
        trial.outcome.breach("place: outside the texture", f"{low} to {high}")


def _check_orientation(trial: Trial) -> None:
    """Check that no triangle is flipped or collapsed, and that the report counts them correctly."""
    chart = plane.charts_of(trial.result.uv_faces)
    against = int(plane.flipped(trial.corners, chart).sum())
    told = trial.result.distortion
    if against != told.flipped:
        trial.outcome.breach("flipped: report differs", f"{told.flipped} reported, {against} measured")
    if against:
        trial.broken("flipped", f"flipped triangles, {_method(trial)}", f"{against} triangles")
    if told.degenerate:
        trial.broken("collapsed", f"triangles collapsed, {_method(trial)}", f"{told.degenerate} triangles")


def _check_needles(trial: Trial) -> None:
    """Check that triangles that are distorted beyond use are named."""
    distortion = trial.result.distortion.qc
    count = int(np.count_nonzero(distortion > 1e3))
    if count:
        trial.broken("needles", "triangles distorted beyond use", f"{count}, up to {distortion.max():.3g}")


def _check_overlap(trial: Trial) -> None:
    """Check that nothing overlaps in an atlas, and that the report measures overlaps correctly."""
    from coneflat.geometry.overlap import find_overlaps

    overlap = find_overlaps(trial.corners)
    told = trial.result.distortion
    if len(overlap.pairs) != told.overlapping_pairs:
        trial.outcome.breach(
            "overlap: report differs", f"{told.overlapping_pairs} reported, {len(overlap.pairs)} measured"
        )
    if len(trial.corners) <= ALL_PAIRS:
        depth = plane.overlap_depths(trial.corners)
        extent = float(np.ptp(trial.result.uv, axis=0).max())
        is_found = np.zeros(depth.shape, dtype=bool)
        is_found[tuple(overlap.pairs.T)] = True
        # The normals of shorter sides are not known well enough, nor is the orientation of what has hardly an area.
        short = trial.sides.min(axis=1) < plane.SHORT * extent
        short |= np.abs(plane.double_areas(trial.corners)) < plane.NO_AREA * extent**2
        depth[short], depth[:, short], is_found[short], is_found[:, short] = -1.0, -1.0, False, False
        if ((np.triu(depth, 1) > plane.DEEP * extent) & ~is_found).any():
            trial.outcome.breach("overlap: missed by find_overlaps", "")
        if (is_found & (depth < -plane.DEEP * extent)).any():
            trial.outcome.breach("overlap: invented by find_overlaps", "")
    if len(overlap.pairs) and trial.options.get("charts") == "atlas":
        trial.broken("overlap", f"overlap in an atlas, {_method(trial)}", f"{len(overlap.pairs)} pairs")


def _check_angles(trial: Trial) -> None:
    """Check that angle sums of inner vertices are 2 pi minus the curvature of cones."""
    if trial.method != "exact":
        return
    result, topology = trial.result, trial.topology
    error = np.abs(_angle_sums(trial) - TURN + _spread(trial, result.cones, result.curvatures))
    error = np.maximum(error - _angle_rounding(trial), 0.0)
    at = topology.is_used & ~topology.is_border
    if trial.is_marked:  # the sides of a marked seam are a boundary
        at[topology.edges[topology.inner[trial.topology.is_seam(trial.result.uv_faces)]]] = False
        at[result.cones] = True
    off = np.flatnonzero(at & (error > ANGLE))
    if len(off):
        worst = off[np.argmax(error[off])]
        kind = "a full turn" if error[worst] > 6 else "less than a full turn"
        trial.broken(
            "angles",
            f"angle off by {kind}, {_method(trial)}",
            f"{len(off)} of {at.sum()} vertices, {worst} by {error[worst]:.3g} rad",
        )
    worst = error[at].max(initial=0.0)
    told = max(result.distortion.curvature_error_max * np.pi, result.distortion.angle_sum_error)
    if worst > ANGLE and not told > worst / 2:
        trial.outcome.breach("curvature error understated", f"{told:.3g} rad reported, {worst:.3g} measured")


def _check_sides(trial: Trial) -> None:
    """Check that the two sides of every seam have equal lengths."""
    if trial.method != "exact":
        return
    first, second = trial.sides.ravel()[trial.topology.sides].T
    is_opened = any("without area" in note for note in trial.result.notes)
    off = np.abs(first - second) / np.maximum(np.maximum(first, second), EPS)
    off -= 8 * EPS / np.maximum(np.minimum(first, second), EPS)
    cause = f"sides of seams differ, {_method(trial)}{', marked' if trial.is_marked else ''}"
    bad = off > (LOOSE_SIDES if is_opened else SIDES)
    is_named = bad & (off <= _named_differences(trial, bad))
    if is_named.any():
        trial.outcome.excuse(cause)
    bad &= ~is_named
    if bad.any():
        trial.broken("sides", cause, f"{bad.sum()} edges, by up to {off[bad].max():.3g}")


def _named_differences(trial: Trial, bad: np.ndarray) -> np.ndarray:
    """Return (k,) the largest relative differences of the sides of inner edges that notes name, up to `LOOSE_SIDES`.

    bad: (k,) the edges whose sides differ.
    """
    result, topology = trial.result, trial.topology
    named = np.zeros(len(topology.inner))
    for note in result.notes:
        if match := NO_ROOM.match(note):
            is_named = np.isin(result.vertex_origin, [int(name) for name in re.findall(r"\d+", match[1])])
            for _ in range(NO_ROOM_RINGS):
                is_named[result.faces[is_named[result.faces].any(axis=1)]] = True
            named[is_named[topology.edges[topology.inner]].any(axis=1)] = LOOSE_SIDES
        elif (match := NOT_KEPT.match(note)) and trial.is_marked:
            seams = np.flatnonzero(bad & topology.is_seam(result.uv_faces))
            if len(seams) <= int(match[1].replace(",", "")):
                named[seams] = np.maximum(named[seams], min(BOTH_SIDES * float(match[2]), LOOSE_SIDES))
    return named


def _check_boundary(trial: Trial) -> None:
    """Check that the boundary has the prescribed shape."""
    if trial.method != "exact" or trial.is_marked or not trial.topology.is_border.any():
        return
    if trial.boundary == "lengths":
        _check_boundary_lengths(trial)
    elif trial.boundary in ("disk", "straight") or not isinstance(trial.boundary, str):
        _check_boundary_turns(trial)


def _check_boundary_lengths(trial: Trial) -> None:
    at = trial.result.vertices[trial.result.faces]
    # By a power of two, lest squares of tiny or huge lengths are not numbers.
    exponent = int(np.frexp(np.abs(at).max())[1])
    at = np.ldexp(at, -exponent)
    space, flat = plane.side_lengths(at).ravel(), trial.sides.ravel()
    border = np.isin(
        trial.topology.edge_of_halfedges(trial.result.faces), np.flatnonzero(trial.topology.count == 1)
    )
    targets = space[border] * np.ldexp(trial.result.uv_scale, exponent)
    coarse = EPS * np.abs(at).max() / np.maximum(space[border], np.finfo(float).tiny)
    off = np.abs(flat[border] - targets) / np.maximum(targets, np.finfo(float).tiny)
    off -= 1e-7 + 8 * coarse + 8 * EPS / np.maximum(targets, EPS)
    if off.max() > 0:
        trial.broken(
            "lengths", "boundary lengths not kept", f"{(off > 0).sum()} edges, by up to {off.max():.3g}"
        )


def _check_boundary_turns(trial: Trial) -> None:
    """Check the curvature of the boundary: uniform on round loops, zero along straight sides."""
    curvature = np.pi - _angle_sums(trial)
    slack = ANGLE + _angle_rounding(trial)
    if trial.boundary == "straight":
        _check_straight_boundary(trial, curvature, slack)
    else:
        _check_loops(trial, curvature, slack)


def _check_straight_boundary(trial: Trial, curvature: np.ndarray, slack: np.ndarray) -> None:
    """Check that sides are straight, or that corners turn by multiples of the quantum."""
    is_border, quantum = trial.topology.is_border, trial.options.get("quantise")
    if quantum is None:
        # Corners are found like cones, and there may be many; sides between them are straight.
        off = is_border & (np.abs(curvature - np.nan_to_num(trial.result.prescribed)) > slack)
        if off.any():
            trial.broken("angles", "boundary not straight", f"{off.sum()} vertices")
        return
    off = (plane.difference_from_multiple(curvature, quantum) - slack)[is_border]
    if (off > 0).any():
        trial.broken("angles", "corners are no multiples", f"by {off.max():.3g} rad")


def _check_loops(trial: Trial, curvature: np.ndarray, slack: np.ndarray) -> None:
    """Check round loops, and loops with named corners between straight sides."""
    result, topology = trial.result, trial.topology
    named = dict.fromkeys(trial.boundary) if not isinstance(trial.boundary, (str, dict)) else trial.boundary
    # Another copy of a vertex may be inside.
    is_named = np.isin(result.vertex_origin, list(named) if isinstance(named, dict) else [])
    corner_at = np.flatnonzero(is_named & topology.is_border)
    share = _border_lengths(trial)
    for loop in topology.border_loops():
        if (
            isinstance(named, dict)
            and not np.isin(topology.component[corner_at], topology.component[loop]).any()
        ):
            continue  # components without a corner are free
        if np.isin(corner_at, loop).any():
            sides = np.setdiff1d(loop, corner_at)
            off = np.abs(curvature[sides]) - slack[sides]
            promise, cause = "angles", "straight sides not held"
        else:
            targets = curvature[loop].sum() * share[loop] / share[loop].sum()
            off = np.abs(curvature[loop] - targets) - slack[loop] - ROUND * np.abs(targets)
            promise, cause = "round", "round boundary not held"
        if off.max(initial=-1) > 0:
            trial.broken(
                promise, cause, f"by {off.max():.3g} rad at {(off > 0).sum()} of {len(loop)} vertices"
            )
    if isinstance(named, dict) and any(k is not None for k in named.values()):
        targets = np.array([named[v] for v in result.vertex_origin[corner_at]], dtype=np.float64)
        off = np.abs(curvature[corner_at] - targets) - slack[corner_at] - 1e-6
        if off.max(initial=-1) > 0:
            trial.broken("angles", "corners not held", f"by {off.max():.3g} rad")


def _border_lengths(trial: Trial) -> np.ndarray:
    """Return (n,) half the length of the boundary edges at each vertex, in the plane."""
    topology = trial.topology
    length = np.empty(len(topology.edges))
    length[topology.edge_of_halfedges(trial.result.faces)] = trial.sides.ravel()
    share = np.zeros(len(trial.result.vertices))
    is_border_edge = topology.count == 1
    np.add.at(share, topology.edges[is_border_edge].ravel(), np.repeat(length[is_border_edge] / 2, 2))
    return share


def _check_rotations(trial: Trial) -> None:
    """Check that rotations across seams are multiples of the quantum, and that the report has the deviation."""
    quantum = trial.options.get("quantise")
    if quantum is None:
        return
    half, twins = trial.topology.sides.T
    points = trial.corners[..., 0] + 1j * trial.corners[..., 1]
    steps = (np.roll(points, -1, axis=1) - points).ravel()
    lengths = np.minimum(np.abs(steps[half]), np.abs(steps[twins]))
    with np.errstate(divide="ignore", invalid="ignore"):
        turn = np.angle(-steps[twins] / steps[half])
    slack = ANGLE + 16 * EPS / np.maximum(lengths, EPS)
    is_long = lengths > 1e-12
    off = plane.difference_from_multiple(turn[is_long], quantum)
    worst = float(off.max(initial=0.0))
    told = None if trial.result.rotations is None else trial.result.rotations.worst
    rounding = 2 * slack[is_long].max(initial=0.0)
    # Across a marked seam nothing says how the sides are turned, and whether it counts is a matter of taste.
    if told is None or told > worst + rounding or (told < worst - rounding and not trial.is_marked):
        trial.outcome.breach("rotations: report differs", f"{told} reported, {worst:.3g} rad measured")
    if (off > slack[is_long]).any() and trial.method == "exact" and _must_turn_by_quanta(trial):
        trial.broken("rotations", "rotations are no multiples", f"off by {worst:.3g} rad")


def _must_turn_by_quanta(trial: Trial) -> bool:
    """Return whether cones alone determine rotations across seams: no handles, one boundary at most, nothing marked."""
    if trial.is_marked or not isinstance(trial.options.get("cones", "auto"), str):
        return False
    topology, faces = trial.topology, trial.result.faces
    loops = [int(topology.component[loop[0]]) for loop in topology.border_loops()]
    return all(
        topology.euler(faces, component) == 2 - loops.count(component)
        and loops.count(component) <= (0 if trial.boundary == "straight" else 1)
        for component in np.unique(topology.component[topology.is_used]).tolist()
    )


def _check_cones(trial: Trial) -> None:
    """Check that cones are the requested ones, and that their curvatures satisfy Gauss-Bonnet."""
    cones = trial.result.cones
    if len(set(cones.tolist())) != len(cones):
        trial.outcome.breach("cones: one twice", cones)
    _check_cone_sums(trial)
    if isinstance(trial.options.get("cones", "auto"), str):
        _check_searched_cones(trial)
    else:
        _check_given_cones(trial)


def _check_cone_sums(trial: Trial) -> None:
    """Check Gauss-Bonnet on each closed component."""
    result, topology = trial.result, trial.topology
    for component in np.unique(topology.component[topology.is_used]).tolist():
        is_inside = topology.component == component
        if trial.method == "exact" and not trial.is_marked and not (is_inside & topology.is_border).any():
            expected = TURN * topology.euler(result.faces, component)
            total = result.curvatures[is_inside[result.cones]].sum()
            if abs(total - expected) > ANGLE * max(1, len(result.cones)):
                trial.breach("cones: sum of curvatures", f"{total:.6g} instead of {expected:.6g}")


def _check_given_cones(trial: Trial) -> None:
    """Check that cones are those of the options, with their curvatures if these have any."""
    result, expected = trial.result, trial.options["cones"]
    names = result.vertex_origin[result.cones].tolist()
    if set(names) != {int(v) for v in expected}:
        trial.breach("cones: not those given", f"{names} instead of {list(expected)}")
    elif isinstance(expected, dict):
        off = max((abs(expected[v] - k) for v, k in zip(names, result.curvatures, strict=True)), default=0)
        if off > ANGLE:
            trial.breach("cones: not the curvatures given", f"off by {off:.3g}")


def _check_searched_cones(trial: Trial) -> None:
    """Check that a search has heeded its constraints."""
    result, options, topology = trial.result, trial.options, trial.topology
    cones, curvatures = result.cones, result.curvatures
    names = result.vertex_origin[cones].tolist()
    missing = set(options.get("required_cones") or ()) - set(names)
    forbidden = set(options.get("forbidden_cones") or ()) & set(names)
    if missing or forbidden:
        trial.breach("cones: constraints", f"missing {missing}, forbidden {forbidden}")
    count = options.get("cone_count")
    is_one = len(np.unique(topology.component[topology.is_used])) == 1 and not trial.is_marked
    if count is not None and is_one and len(cones) != count and trial.boundary != "straight":
        inside = int((topology.is_used & ~topology.is_border).sum())
        reason = ", few inner vertices" if inside < count else ""
        reason = reason if trial.boundary in ("free", "lengths") else ", prescribed boundary"
        trial.broken("cone count", f"cones: not so many{reason}", f"{len(cones)} instead of {count}")
    if options.get("positive_only") and (curvatures < -ANGLE).any():
        trial.breach("cones: negative", curvatures.min())
    quantum = options.get("quantise")
    if (
        quantum is not None
        and len(cones)
        and plane.difference_from_multiple(curvatures, quantum).max() > ANGLE
    ):
        trial.breach("cones: no multiples", plane.difference_from_multiple(curvatures, quantum).max())


def _check_area(trial: Trial) -> None:
    """The area distortion of the triangles is at most the one allowed, where cones are searched for it."""
    options, result = trial.options, trial.result
    unbounded = ("cone_count", "weights", "quantise", "lengths", "relax")
    if trial.method != "exact" or options.get("cones", "auto") not in ("auto", "sparse"):
        return
    if trial.boundary not in ("free", "lengths") or any(options.get(name) is not None for name in unbounded):
        return
    if any(re.match(SENTENCES["area"], note) or "greedy" in note for note in result.notes):
        trial.outcome.excuse("area distortion")
        return
    space = result.vertices[result.faces]
    area = np.linalg.norm(np.cross(space[:, 1] - space[:, 0], space[:, 2] - space[:, 0]), axis=1)
    flat = np.abs(plane.double_areas(trial.corners))
    chosen = (area > 1e-12 * area.max()) & (flat > 0)
    if not chosen.any():
        return
    scale = np.log(flat[chosen] / area[chosen]) / 2
    mean = np.average(scale, weights=area[chosen])
    std = np.sqrt(np.average((scale - mean) ** 2, weights=area[chosen]))
    if std > max(1.1 * options.get("distortion", 0.2), 1e-12):  # rounding
        trial.broken("area", "area distortion above the one allowed", f"{std:.3g}")


def _check_report(trial: Trial) -> None:
    """Check that the report is JSON without NaN, and that its texts are readable."""
    from coneflat.measures.report import as_rows

    json.dumps(trial.result.report(), allow_nan=False)
    repr(trial.result)
    for text in (*trial.result.notes, *(value for _, value, _ in as_rows(trial.result))):
        if re.search(r"\bnan\b", text):
            trial.outcome.breach("report: speaks of nan", text)


def _method(trial: Trial) -> str:
    if isinstance(trial.boundary, str):
        return trial.method + ("" if trial.boundary == "free" else f", {trial.boundary}")
    return f"{trial.method}, polygon"


def _angle_sums(trial: Trial) -> np.ndarray:
    return _spread(trial, trial.result.faces.ravel(), plane.angles(trial.corners).ravel())


def _angle_rounding(trial: Trial) -> np.ndarray:
    """Return the (n,) changes of angle sums of vertices due to rounded points."""
    shorter = np.minimum(trial.sides, np.roll(trial.sides, 1, axis=1))
    return _spread(trial, trial.result.faces.ravel(), 4 * EPS / np.maximum(shorter.ravel(), EPS))


def _spread(trial: Trial, at: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.bincount(at, values, minlength=len(trial.result.vertices))
