from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapes
from scaled import noisy, with_cones, with_scale

from coneflat import TriangleMesh, check_mesh, cut_open, edge_lengths, errors, find_seams, mollify, read_mesh
from coneflat.flat.exact.metric import exact_metric
from coneflat.geometry.intrinsic import intrinsic_triangulation
from coneflat.geometry.straight import place_triangles, straight_triangles
from coneflat.geometry.triangles import corner_angles, double_areas
from coneflat.input.arrays import as_input
from coneflat.layout.overlay import overlay
from coneflat.layout.refine import refine
from coneflat.layout.unfold import unfold

TETRAHEDRON = (
    np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]]),
    np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]),
)


def areas(vertices, faces):
    a, b, c = vertices[faces].swapaxes(0, 1)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


def check_laws(mesh, metric, refined, tolerance=1e-10):
    """What holds for every refinement."""
    n, copies = len(mesh.vertices), 1 + metric.doubled
    new, flat = refined.mesh, refined.flat

    # Nothing is turned over, and the flat pieces make up the flat surface.
    assert not flat.is_inverted.any()
    lengths = np.abs(flat.sides).reshape(-1, 3)
    total = double_areas(metric.triangulation.length.reshape(-1, 3)).sum() / copies
    assert double_areas(lengths).sum() == pytest.approx(total, rel=1e-9)
    np.testing.assert_allclose(flat.sides.reshape(-1, 3).sum(axis=1), 0, atol=1e-12 * lengths.max())

    # Crossings are flat, vertices have the metric's curvature.
    sums = np.bincount(new.faces.ravel(), corner_angles(lengths).ravel(), len(new.vertices))
    curvature = np.where(new.is_boundary_vertex, np.pi, 2 * np.pi) - sums
    np.testing.assert_allclose(curvature[n:], 0, atol=1e-9)
    np.testing.assert_allclose(curvature[:n], metric.curvature, atol=1e-9)

    # Both sides of every edge agree.
    inner = np.flatnonzero(flat.twin >= 0)
    across = flat.turns[inner] * flat.sides[flat.twin[inner]]
    np.testing.assert_allclose(flat.sides[inner], -across, atol=1e-12 * lengths.max())
    np.testing.assert_allclose(np.abs(flat.turns), 1)

    # In space the pieces tile the faces.
    assert np.array_equal(new.vertices[:n], mesh.vertices)
    assert np.array_equal(np.unique(refined.face_origin), np.arange(len(mesh.faces)))
    before = areas(mesh.vertices, mesh.faces)
    after = areas(new.vertices, new.faces)
    assert after.min() > 0
    np.testing.assert_allclose(
        np.bincount(refined.face_origin, after), before, rtol=tolerance, atol=1e-12 * before.max()
    )
    one = np.cross(*(new.vertices[new.faces[:, i]] - new.vertices[new.faces[:, 0]] for i in (1, 2)))
    two = np.cross(*(mesh.vertices[mesh.faces[:, i]] - mesh.vertices[mesh.faces[:, 0]] for i in (1, 2)))
    assert ((one * two[refined.face_origin]).sum(axis=1) > 0).all()

    # The surface is the same.
    checked = check_mesh(new.vertices, new.faces)
    assert len(checked.mesh.faces) == len(new.faces)
    assert new.euler_characteristic == mesh.euler_characteristic
    assert new.components[0] == mesh.components[0]
    assert new.boundary_loops[0] == mesh.boundary_loops[0]
    crossings = len(refined.crossing_edges)
    assert len(new.vertices) == n + crossings

    # Every input edge is there in pieces, one more than it has crossings.
    pieces = np.bincount(refined.halfedge_edges[refined.halfedge_edges >= 0], minlength=len(mesh.edges))
    per_edge = 1 + np.bincount(refined.crossing_edges, minlength=len(mesh.edges))
    assert np.array_equal(pieces, per_edge * np.where(mesh.is_boundary_edge, 1, 2))
    on_edges = np.bincount(
        refined.halfedge_edges[refined.halfedge_edges >= 0],
        edge_lengths(new.vertices, new.faces).ravel()[refined.halfedge_edges >= 0],
    )
    whole = np.linalg.norm(np.diff(mesh.vertices[mesh.edges], axis=1)[:, 0], axis=1)
    np.testing.assert_allclose(on_edges, whole * np.where(mesh.is_boundary_edge, 1, 2), rtol=1e-9)
    assert (refined.crossing_weights > 0).all()
    np.testing.assert_allclose(refined.crossing_weights.sum(axis=1), 1)
    np.testing.assert_allclose(refined.interpolate(mesh.vertices, mesh.edges), new.vertices, atol=1e-12)
    assert np.isfinite(refined.log_scale).all()
    assert np.array_equal(refined.log_scale[:n], metric.log_scale)


def test_without_flips_the_mesh_stays_as_it_is():
    mesh, metric = with_scale(shapes.sphere(2), 0.01)
    assert len(metric.flips) == 0
    refined = refine(mesh, metric)
    assert np.array_equal(refined.mesh.vertices, mesh.vertices)
    assert np.array_equal(refined.mesh.faces, mesh.faces)
    assert np.array_equal(refined.face_origin, np.arange(len(mesh.faces)))
    assert np.array_equal(refined.halfedge_edges, mesh.halfedge_edges)
    straight = straight_triangles(metric.triangulation, metric.flips)
    assert np.array_equal(refined.flat.sides, straight.sides)
    assert np.array_equal(refined.flat.turns, straight.turns)
    assert np.array_equal(refined.flat.twin, straight.twin)
    check_laws(mesh, metric, refined)


def test_hand_computed_quad():
    # Two obtuse triangles on a long side from s to e. By Ptolemy's relation the other diagonal has the
    # length (l_sa l_eb + l_sb l_ea) / l_se, and the crossing is nearer to s by the factor l_ea l_eb / l_sa l_sb.
    vertices = np.array([[0, 0, 0], [4, 0, 0], [1, 1, 0], [1, -1.5, 0]])
    mesh = TriangleMesh(vertices, np.array([[0, 1, 2], [1, 0, 3]]))
    sa, sb, ea, eb = 2**0.5, 3.25**0.5, 10**0.5, 11.25**0.5
    everywhere = np.ones(4, dtype=bool)
    metric = exact_metric(
        mesh, edge_lengths(vertices, mesh.faces), np.zeros(4), fixed=everywhere, delaunay=False
    )
    assert len(metric.flips) == 1
    refined = refine(mesh, metric)
    assert len(refined.mesh.faces) == 4
    assert refined.mesh.vertices[4, 0] == pytest.approx(4 * sa * sb / (sa * sb + ea * eb))
    diagonal = (sa * eb + sb * ea) / 4
    lengths, faces = np.abs(refined.flat.sides).reshape(-1, 3), refined.mesh.faces
    by_pair = {}
    for i in range(3):
        for pair, length in zip(np.sort(np.delete(faces, i, axis=1)).tolist(), lengths[:, i], strict=True):
            by_pair[tuple(pair)] = length
    # On the flat edge from a to b the crossing divides it as l_sa l_ea : l_sb l_eb.
    assert by_pair[2, 4] == pytest.approx(diagonal * sa * ea / (sa * ea + sb * eb))
    assert by_pair[3, 4] == pytest.approx(diagonal * sb * eb / (sa * ea + sb * eb))
    assert by_pair[0, 2] == pytest.approx(sa)
    check_laws(mesh, metric, refined)


@pytest.mark.parametrize("spread", [0.5, 1.5, 4.0])
@pytest.mark.parametrize(
    "shape",
    [TETRAHEDRON, shapes.sphere(0), shapes.sphere(2), shapes.torus(12, 6), shapes.genus(2)],
    ids=["tetrahedron", "icosahedron", "sphere", "torus", "genus2"],
)
def test_laws_for_wild_scales(shape, spread):
    # Down to triangles glued to themselves around vertices with a single edge.
    mesh, metric = with_scale(shape, spread)
    check_laws(mesh, metric, refine(mesh, metric))


def test_wild_scales_make_loops():
    _, metric = with_scale(shapes.sphere(2), 4.0)
    flat = metric.triangulation
    assert np.bincount(flat.tail).min() == 1
    assert (flat.twin // 3 == np.arange(len(flat.twin)) // 3).any()
    assert straight_triangles(flat, metric.flips).is_inverted.any()


@pytest.mark.parametrize("shape", [shapes.hill(8, 6), shapes.annulus(12, 3)], ids=["hill", "annulus"])
def test_laws_for_doubled_surfaces(shape):
    mesh, metric = with_scale(shape, 1.0)
    assert metric.doubled
    refined = refine(mesh, metric)
    check_laws(mesh, metric, refined)
    assert mesh.is_boundary_edge[refined.crossing_edges].any()


@pytest.mark.parametrize(
    "shape",
    [
        noisy(shapes.sphere(2), 0.08),
        noisy(shapes.torus(24, 12), 0.04),
        noisy(shapes.genus(2), 0.04),
        shapes.join(noisy(shapes.sphere(1), 0.1), noisy(shapes.sphere(1), 0.1, 1)),
    ],
    ids=["sphere", "torus", "genus2", "two"],
)
def test_laws_for_cones_on_noisy_meshes(shape):
    mesh = TriangleMesh(*shape)
    count, labels = mesh.components
    target = np.zeros(len(mesh.vertices))
    for part in range(count):
        cones = np.flatnonzero(labels == part)[:6]
        target[cones] = 2 * np.pi * mesh.euler_characteristic / count / 6
    metric = exact_metric(mesh, edge_lengths(mesh.vertices, mesh.faces), target, delaunay=False)
    assert metric.converged
    assert len(metric.flips)
    check_laws(mesh, metric, refine(mesh, metric))


def test_slivers():
    vertices, faces = shapes.torus(20, 20)
    vertices[:, 2] *= 1e-3
    mesh, metric = with_scale((vertices, faces), 0.2)
    check_laws(mesh, metric, refine(mesh, metric), 1e-6)


def klein_distance(points, centre, radius):
    """Distance of pairs of points in the disk seen as the projective model of the hyperbolic plane."""
    p, q = (points.T - centre) / radius
    inner = 1 - (np.conj(p) * q).real
    ratio = (inner**2 - (1 - abs(p) ** 2) * (1 - abs(q) ** 2)) / inner**2
    return np.arctanh(np.sqrt(np.maximum(ratio, 0)))


@pytest.mark.parametrize("spread", [0.5, 1.0])
def test_map_is_an_isometry_of_ideal_triangles(spread):
    # The distance of neighbouring crossings on an input edge, measured in the circumcircles of the flat triangles.
    mesh, metric = with_scale(shapes.torus(14, 8), spread)
    flat = metric.triangulation
    given = intrinsic_triangulation(mesh, edge_lengths(mesh.vertices, mesh.faces))
    found = overlay(given, flat, metric.flips, metric.log_scale)
    x = np.flatnonzero(found.leaving[1:] == found.leaving[:-1])
    assert len(x) > 20
    t = np.log(found.on_leaving[:, 1] / found.on_leaving[:, 0])
    expected = (t[x + 1] - t[x]) / 2

    sides = np.empty(len(flat.twin), dtype=complex)
    place_triangles(flat.length, sides)
    sides = sides.reshape(-1, 3)
    corners = np.stack([np.zeros(len(sides)), sides[:, 2], -sides[:, 1]], axis=1)  # corner 0 at the origin

    def place(halfedge, weights):
        start = corners[halfedge // 3, (halfedge + 1) % 3]
        return weights[:, 0] * start + weights[:, 1] * (start + sides.ravel()[halfedge])

    into, out = flat.twin[found.crossed[x]], found.crossed[x + 1]
    assert np.array_equal(into // 3, out // 3)
    points = np.stack(
        [place(into, found.on_crossed[x][:, ::-1]), place(out, found.on_crossed[x + 1])], axis=1
    )
    b, c = corners[into // 3, 1:].T
    centre = (abs(b) ** 2 * c - abs(c) ** 2 * b) / (np.conj(b) * c - b * np.conj(c))
    np.testing.assert_allclose(abs(centre - b), abs(centre))
    np.testing.assert_allclose(klein_distance(points, centre, abs(centre)), expected, rtol=1e-6, atol=1e-9)


def test_single_crossings_from_the_lengths_of_the_input():
    # In the quad around an input edge se that is crossed by just one flat edge, the one from a to b.
    mesh, metric = with_scale(shapes.sphere(2), 0.4)
    refined = refine(mesh, metric)
    lengths = edge_lengths(mesh.vertices, mesh.faces)
    per_edge = np.bincount(refined.crossing_edges, minlength=len(mesh.edges))
    checked = 0
    for edge, weights in zip(refined.crossing_edges, refined.crossing_weights, strict=True):
        one, two = mesh.edge_halfedges[edge]
        around = mesh.halfedge_edges.reshape(-1, 3)[[one // 3, two // 3]]
        if per_edge[around].sum() > 2:  # the edge itself, twice
            continue
        checked += 1
        (to_e, from_s), (to_s, from_e) = (
            (lengths[h // 3, (h + 1) % 3], lengths[h // 3, (h + 2) % 3]) for h in (one, two)
        )
        tail, head = to_e * from_e, from_s * to_s
        if mesh.tails[one] != mesh.edges[edge, 0]:
            tail, head = head, tail
        np.testing.assert_allclose(weights, np.array([tail, head]) / (tail + head))
    assert checked > 5


def test_common_scale_changes_nothing():
    mesh, metric = with_scale(shapes.torus(12, 6), 1.0)
    refined = refine(mesh, metric)
    larger = metric.triangulation.copy()
    larger.length *= np.exp(3.0)
    again = refine(mesh, replace(metric, triangulation=larger, log_scale=metric.log_scale + 3))
    assert np.array_equal(again.mesh.faces, refined.mesh.faces)
    np.testing.assert_allclose(again.crossing_weights, refined.crossing_weights, rtol=1e-9)
    np.testing.assert_allclose(again.log_scale, refined.log_scale + 3, atol=1e-9)
    np.testing.assert_allclose(again.flat.sides, refined.flat.sides * np.exp(3.0), atol=1e-8)


def test_log_scale_at_crossings_is_bounded_by_convexity():
    # The flat triangulation being Delaunay, none of the light cone vectors exp(phi_i) v_i lies below the planes
    # of its triangles; so their functional is at least the linear one on the input's edge. The other way round
    # for v_i and the input's triangles, which are Delaunay here.
    mesh, metric = with_scale(shapes.sphere(2), 1.0)
    _, plain = with_scale(shapes.sphere(2), 0.0)
    assert len(plain.flips) == 0
    phi, flat = metric.log_scale, metric.triangulation
    refined = refine(mesh, metric)
    on_input = (refined.crossing_weights * np.exp(-phi[mesh.edges[refined.crossing_edges]])).sum(axis=1)
    found = refined.log_scale[len(mesh.vertices) :]
    assert (found <= -np.log(on_input) + 1e-9).all()

    given = intrinsic_triangulation(mesh, edge_lengths(mesh.vertices, mesh.faces))
    crossings = overlay(given, flat, metric.flips, phi)
    ends = np.stack([flat.tail[crossings.crossed], flat.tail[flat.twin[crossings.crossed]]], axis=1)
    on_flat = (crossings.on_crossed * np.exp(phi[ends])).sum(axis=1)
    assert (crossings.log_scale >= np.log(on_flat) - 1e-9).all()


def unfolded(mesh, cones, refined, **choices):
    """The refined mesh in the plane, cut along edges of the input: cut faces, points, and the cut."""
    costs = np.linalg.norm(np.diff(mesh.vertices[mesh.edges], axis=1)[:, 0], axis=1)
    seams = find_seams(mesh, cones, costs, **choices)
    edges = refined.edges_on(seams)
    cut = cut_open(refined.mesh, edges).mesh
    return seams, edges, cut, unfold(refined.flat, cut.faces) @ [1, 1j]


def test_seams_and_layout():
    mesh, cones, metric = with_cones(noisy(shapes.sphere(3), 0.03))
    refined = refine(mesh, metric)
    seams, edges, cut, points = unfolded(mesh, cones, refined)
    crossed = np.isin(refined.crossing_edges, seams).sum()
    assert crossed > 0
    assert len(edges) == len(seams) + crossed
    corners = points[cut.faces]
    doubled = (np.conj(corners[:, 1] - corners[:, 0]) * (corners[:, 2] - corners[:, 0])).imag
    assert doubled.min() > 0
    sides = np.abs(corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]]).ravel()
    one, two = refined.mesh.edge_halfedges[edges].T
    np.testing.assert_allclose(sides[one], sides[two], atol=1e-11)


def test_vertices_have_the_places_that_undoing_the_flips_finds():
    mesh, cones, metric = with_cones(noisy(shapes.sphere(2), 0.05))
    refined = refine(mesh, metric)
    assert len(refined.crossing_edges)
    # So that both are cut along the same lines.
    seams, edges, cut, points = unfolded(mesh, cones, refined, forbidden=refined.crossing_edges)
    assert len(edges) == len(seams)
    straight = straight_triangles(metric.triangulation, metric.flips)
    disk = cut_open(mesh, seams).mesh
    expected = unfold(straight, disk.faces) @ [1, 1j]
    # The corners of each face that are corners of its pieces, too.
    piece, corner = np.nonzero(refined.mesh.faces < len(mesh.vertices))
    face, vertex = refined.face_origin[piece], refined.mesh.faces[piece, corner]
    which = (mesh.faces[face] == vertex[:, None]).argmax(axis=1)
    here, there = points[cut.faces[piece, corner]], expected[disk.faces[face, which]]
    here, there = here - here[0], there - there[0]
    far = abs(there).argmax()
    np.testing.assert_allclose(here, there * (here[far] / there[far]), atol=1e-10)


def test_other_meshes_metrics_are_refused():
    shape = noisy(shapes.sphere(2), 0.08)
    mesh, _, metric = with_cones(shape, delaunay=True)
    assert metric.euclidean_flips
    with pytest.raises(errors.MetricError, match="delaunay=False"):
        refine(mesh, metric)
    _, metric = with_scale(shape, 0.5)
    with pytest.raises(errors.MetricError, match="different meshes"):
        refine(TriangleMesh(*shapes.sphere(1)), metric)
    vertices, faces, _ = shapes.renumber(*shape)
    with pytest.raises(errors.MetricError, match="different meshes"):
        refine(TriangleMesh(vertices, faces), metric)


@pytest.mark.parametrize(
    "name", ["horse.ply", "camelhead.off", "stanford-bunny.obj", "face.obj", "fandisk.obj"]
)
def test_no_triangle_is_turned_over_on_real_meshes(shared, name):
    model = as_input(read_mesh(shared(name)), None)
    parts = check_mesh(model.vertices, model.faces, repair=True).mesh.split_components()
    mesh = max(parts, key=lambda part: len(part[0].faces))[0]
    lengths, _ = mollify(edge_lengths(mesh.vertices, mesh.faces))
    free = mesh.is_boundary_vertex.copy()
    free[farthest_points(mesh, 12)] = True
    metric = exact_metric(mesh, lengths, np.zeros(len(mesh.vertices)), fixed=free, delaunay=False)
    assert metric.converged
    refined = refine(mesh, metric)
    assert len(refined.crossing_edges) > 1000
    check_laws(mesh, metric, refined, 1e-6)


def farthest_points(mesh, count):
    """Spread vertices, each the farthest from those before."""
    chosen = [0]
    distance = np.full(len(mesh.vertices), np.inf)
    while len(chosen) < count:
        distance = np.minimum(distance, np.linalg.norm(mesh.vertices - mesh.vertices[chosen[-1]], axis=1))
        chosen.append(int(np.argmax(distance)))
    return np.array(chosen)
