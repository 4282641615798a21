"""Integer grids and quad meshes of random surfaces, and independent checks of their guarantees in numpy."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import shapes

from . import changes, meshes, surfaces
from .choices import in_short
from .meshes import TINY
from .outcome import Outcome
from .surfaces import Random
from .topology import Topology

MAKERS = (
    surfaces.sheet,
    surfaces.ball,
    surfaces.hemisphere,
    surfaces.ring,
    surfaces.tube,
    surfaces.handles,
    surfaces.polycube,
    surfaces.crate,
    surfaces.spikes,
    surfaces.random_hull,
    surfaces.patch,
    surfaces.patch,
)
CHANGES = (
    (changes.hole, 0.15),
    (changes.jitter, 0.15),
    (changes.slivers, 0.05),
    (changes.flips, 0.05),
    (changes.stretched, 0.15),
    (changes.two_parts, 0.05),
    (changes.loose_vertices, 0.05),
    (changes.shuffled, 0.3),
)
#: Fraction of cases with meshes as irregular as those of the hostile trial.
HOSTILE = 0.2
#: Largest distance of a quad vertex from the point given by its barycentric coordinates, relative to the model size.
ROUNDING = 1e-9
TURNS = np.array([1, 1j, -1, -1j])


def make_surface(rng: Random) -> tuple[np.ndarray, np.ndarray, str]:
    """Return vertices, faces and a description; more of these can be flattened than of `meshes.make_mesh`."""
    if rng.random() < HOSTILE:
        return meshes.make_mesh(rng)
    maker = MAKERS[int(rng.integers(len(MAKERS)))]
    vertices, faces = maker(rng)
    vertices, faces = np.array(vertices, dtype=np.float64), np.array(faces, dtype=np.int64)
    recipe = [maker.__name__]
    while len(faces) < 60 and rng.random() < 0.8:
        vertices, faces = shapes.subdivide(vertices, faces)
        recipe.append("subdivide")
    for change, chance in CHANGES:
        if rng.random() < chance and len(faces):
            vertices, faces = change(vertices, faces, rng)
            recipe.append(change.__name__)
    scale = float(rng.choice([1.0, 1.0, 1e-6, 1e6]))
    return vertices * scale, faces, f"{' + '.join(recipe)} x {scale:g}, {len(faces)} faces"


def make_grid_options(rng: Random, vertices: np.ndarray, faces: np.ndarray) -> dict[str, Any]:
    """Return keyword arguments of `coneflat.integer_grid`."""
    options: dict[str, Any] = {}
    kind = rng.random()
    if kind < 0.8:
        options["quads"] = int(10 ** rng.uniform(0.5, 3.7))
    else:
        corners = vertices[faces] if len(faces) and faces.min() >= 0 and faces.max() < len(vertices) else None
        with np.errstate(all="ignore"):
            sides = np.ones(1) if corners is None else np.linalg.norm(corners[:, 0] - corners[:, 1], axis=1)
        options["size"] = float(np.nan_to_num(np.median(sides)) * 10 ** rng.uniform(-0.5, 0.7))
    if rng.random() < 0.3:
        options["stretch"] = float(rng.choice([0.1, 0.5, 1.0, 2.0]))
    if rng.random() < 0.3:
        options["boundary"] = "straight"
    if rng.random() < 0.15:
        options["min_cone_angle"] = float(rng.choice([np.pi / 2, np.pi]))
    if rng.random() < 0.15:
        options["max_cone_angle"] = float(rng.choice([2.5, 4]) * np.pi)
    if rng.random() < 0.15:
        options["distortion"] = float(rng.choice([0.1, 0.5]))
    if rng.random() < 0.1:
        options["repair"] = True
    return options


def grid_case(rng: Random, outcome: Outcome) -> None:
    """Compute the grid and the quads, smoothed or not, of a surface with random options."""
    vertices, faces, made = make_surface(rng)
    grid_of_mesh(rng, outcome, vertices, faces, made)


def grid_of_mesh(
    rng: Random, outcome: Outcome, vertices: np.ndarray, faces: np.ndarray, made: str, **options: Any
) -> None:
    """Compute and check the grid and the quads of a mesh; options: some, instead of random ones."""
    import coneflat

    options = {**make_grid_options(rng, vertices, faces), **options}
    smooth = int(rng.choice([0, 3, 10]))
    outcome.recipe = f"{made}; {in_short(options)}, smooth={smooth}"
    grid = quads = None
    with outcome.guarded(expects_nan=not np.isfinite(vertices).all()):
        grid = coneflat.integer_grid(vertices, faces, **options)
        check_grid(outcome, grid, options)
        quads = coneflat.quads(grid, smooth=smooth)
    if grid is not None and quads is not None:
        check_quads(outcome, quads, grid)


#: Surfaces of the trial of few triangles, and the numbers of quads asked for.
FEW = (
    *[surfaces.needle] * 3,
    *dict.fromkeys(TINY),
    surfaces.spikes,
    surfaces.random_hull,
    surfaces.handles,
)
COUNTS = (1, 2, 5, 10, 30, 100, 1_000, 10_000, 100_000, 1_000_000, 10**9)
#: Largest number of quads, relative to the number asked for.
MAX_TIMES = 16


def few_case(rng: Random, outcome: Outcome) -> None:
    """Make quads of needles and of meshes of few triangles: few or very many quads, with random options."""
    import coneflat

    parts, makers = [], []
    for _ in range(1 if rng.random() < 0.8 else int(rng.integers(2, 5))):
        maker = FEW[int(rng.integers(len(FEW)))]
        vertices, faces = maker(rng)
        stretch = 10.0 ** rng.uniform(-3, 3, 3) if rng.random() < 0.3 else np.ones(3)
        parts.append((vertices * stretch * surfaces.amount(rng, -2, 2), faces))
        makers.append(maker.__name__)
    vertices, faces = shapes.join(*parts)
    options: dict[str, Any] = {"repair": True, "quads": int(rng.choice(COUNTS))}
    for name, values, chance in (
        ("stretch", (0.0, 1.0), 0.5),
        ("boundary", ("free", "straight"), 0.4),
        ("sharp_angle", (0.3, 0.7, 2.0), 0.3),
        ("cones", ("sparse",), 0.25),
        ("smooth", (0, 3), 0.5),
        ("distortion", (0.02, 1.0), 0.2),
    ):
        if rng.random() < chance:
            options[name] = values[int(rng.integers(len(values)))]
    requested = options["quads"]
    if rng.random() < 0.2:
        corners = vertices[faces]
        area = np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        ).sum()
        options["size"] = float(np.sqrt(area / 2 / options.pop("quads"))) or 1.0
    outcome.recipe = f"{' and '.join(makers)}, {len(faces)} faces; {in_short(options)}"
    quads = None
    with outcome.guarded():
        quads = coneflat.quads(vertices, faces, **options)
    if quads is None:
        return
    if not np.isfinite(quads.vertices).all() or not np.isfinite(quads.barycentric).all():
        outcome.breach("quads: not finite", int((~np.isfinite(quads.vertices)).sum()))
    # The area, and with it the number for a size, changes a little by the repair.
    if len(quads.quads) > 1.01 * MAX_TIMES * requested:
        outcome.breach("quads: too many", f"{len(quads.quads):,} for {requested:,}")
    if len(quads.quads) < 50_000 and not np.isfinite(quads.uv).all():
        outcome.breach("quads: UVs not finite")


def check_grid(outcome: Outcome, grid: Any, options: dict[str, Any]) -> None:
    """Check all guarantees of an integer grid; equations must hold exactly."""
    z = grid.corner_grid @ [1, 1j]
    if not np.isfinite(z).all():
        outcome.breach("grid: not finite")
        return
    faces = grid.faces
    topology = Topology.of(faces, len(grid.vertices))
    # Half-edge 3 f + i of a grid lies opposite corner i; that of Topology runs from corner i.
    starts, ends = z[:, [1, 2, 0]].ravel(), z[:, [2, 0, 1]].ravel()
    opposite = topology.sides - topology.sides % 3 + (topology.sides + 2) % 3
    shift = grid.shifts @ [1, 1j]
    for h, t in (opposite.T, opposite[:, ::-1].T):
        off = np.abs(TURNS[grid.turns[h] % 4] * ends[t] + shift[h] - starts[h])
        off = np.maximum(off, np.abs(TURNS[grid.turns[h] % 4] * starts[t] + shift[h] - ends[h]))
        if off.max(initial=0) > 0:
            outcome.breach("grid: seams do not fit exactly", f"by up to {off.max():.2g}")
    doubled = (np.conj(z[:, 1] - z[:, 0]) * (z[:, 2] - z[:, 0])).imag
    if not (doubled > 0).all():
        outcome.breach("grid: triangles flipped", int((doubled <= 0).sum()))
    sides = z[:, [2, 0, 1]] - z[:, [1, 2, 0]]
    angles = np.angle(-sides[:, [1, 2, 0]] * np.conj(sides[:, [2, 0, 1]]))
    sums = np.bincount(faces.ravel(), angles.ravel(), len(grid.vertices)) / (np.pi / 2)
    expected = np.full(len(sums), 4)
    expected[grid.cones] = grid.quarters
    inside = topology.is_used & ~topology.is_border
    if np.abs(sums - expected)[inside].max(initial=0) > 1e-3:
        outcome.breach("grid: angles are not those of cones", np.abs(sums - expected)[inside].max())
    is_node = np.isin(faces, np.concatenate([grid.cones, grid.corners]))
    if (grid.corner_grid[is_node] != np.rint(grid.corner_grid[is_node])).any():
        outcome.breach("grid: cones off the grid points")
    max_quarters = options.get("max_cone_angle", 3 * np.pi) / (np.pi / 2) + 1e-6
    min_quarters = (
        options.get("min_cone_angle", 1.5 * np.pi if "boundary" not in options else 0) / (np.pi / 2) - 1e-6
    )
    # The angles of vertices on sharp edges are sums of those between the edges.
    if (
        len(grid.quarters)
        and "sharp_angle" not in options
        and (grid.quarters.max() > max_quarters or grid.quarters.min() < min_quarters)
    ):
        outcome.breach("grid: cones beyond bounds", sorted(set(grid.quarters.tolist())))


def check_quads(outcome: Outcome, mesh: Any, grid: Any) -> None:
    """Check that quads are an oriented manifold mesh on the surface with its topology."""
    quads, points = mesh.quads, mesh.vertices
    if any("\n" in note or "nan" in note.split() for note in mesh.notes):
        outcome.breach("quads: a note of several lines, or of nan", mesh.notes)
    if not len(quads) or quads.shape[1:] != (4,) or quads.min() < 0 or quads.max() >= len(points):
        outcome.breach("quads: none, or bad indices")
        return
    if (np.diff(np.sort(quads, axis=1), axis=1) == 0).any():
        outcome.breach("quads: a vertex twice in a quad")
    tails, heads = quads.ravel(), np.roll(quads, -1, axis=1).ravel()
    if len(np.unique(tails * len(points) + heads)) < len(tails):
        outcome.breach("quads: two beside an edge on the same side, or three")
    edges = np.unique(np.minimum(tails, heads) * len(points) + np.maximum(tails, heads))
    _check_fans(outcome, quads, len(points))
    euler = len(points) - len(edges) + len(quads)
    surface = Topology.of(grid.faces, len(grid.vertices))
    surface_euler = int(surface.is_used.sum()) - len(surface.edges) + len(grid.faces)
    if euler != surface_euler:
        if _says(mesh, r"The Euler characteristic of the quads is -?[\d,]+, that of the surface"):
            outcome.excuse("Euler characteristic")
        else:
            outcome.breach("quads: another Euler characteristic", f"{euler}, not {surface_euler}")
    z = grid.corner_grid @ [1, 1j]
    doubled = (np.conj(z[:, 1] - z[:, 0]) * (z[:, 2] - z[:, 0])).imag
    if not surface.is_border.any() and abs(doubled.sum() / 2 - len(quads)) > 1e-3:
        outcome.breach("quads: not as many as squares", f"{len(quads)}, {doubled.sum() / 2:.6f}")
    corners = grid.vertices[grid.faces[mesh.faces]]
    placed = np.einsum("qi,qix->qx", mesh.barycentric, corners)
    size = np.ptp(grid.vertices[surface.is_used], axis=0).max()
    off = np.abs(placed - points).max() if np.isfinite(points).all() else np.inf
    if not off <= ROUNDING * size or mesh.barycentric.min() < 0:
        outcome.breach("quads: vertices off the surface", f"{off:.2g} of {size:.2g}")
    if not (np.abs(mesh.barycentric.sum(axis=1) - 1) <= 1e-9).all():
        outcome.breach("quads: barycentric coordinates that are none")
    inverted = _inverted(points, quads)
    if inverted:
        if _says(mesh, r"[\d,]+ quads? with an angle of 180 degrees or more"):
            outcome.excuse("inverted quads")
        else:
            outcome.breach("quads: inverted without a note", inverted)


def _says(mesh: Any, sentence: str) -> bool:
    return any(re.match(sentence, note) for note in mesh.notes)


def _check_fans(outcome: Outcome, quads: np.ndarray, count: int) -> None:
    """Check that the quads around each vertex form one fan: k quads have k or k - 1 common edges."""
    before, after = np.roll(quads, 1, axis=1).ravel(), np.roll(quads, -1, axis=1).ravel()
    at = quads.ravel()
    spokes = np.unique(np.concatenate([at * count + before, at * count + after])) // count
    quads_at, spokes_at = np.bincount(at, minlength=count), np.bincount(spokes, minlength=count)
    if not np.isin(spokes_at - quads_at, [0, 1]).all():
        outcome.breach("quads: a vertex with other than one fan")


def _inverted(points: np.ndarray, quads: np.ndarray) -> int:
    """Return the number of quads with a corner of an orientation opposite to that of their diagonals."""
    corners = points[quads] / max(np.abs(points).max(), np.finfo(float).tiny)
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    smallest = np.full(len(quads), np.inf)
    for i in range(4):
        forward, backward = corners[:, (i + 1) % 4] - corners[:, i], corners[:, i - 1] - corners[:, i]
        smallest = np.minimum(smallest, (np.cross(forward, backward) * normal).sum(axis=1))
    return int((smallest < 0).sum())
