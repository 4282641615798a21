"""Unwrapping for textures: the bound of the energy, the seams, and what cannot be reached."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
import shapes
from command import command
from stored_meshes import at_hand, noisy

import coneflat
from coneflat import errors, measure_uv, unwrap
from coneflat.atlas import ChartLayout, with_charts
from coneflat.flattening import Steps
from coneflat.geometry import corner_angles, signed_double_areas
from coneflat.io import as_input
from coneflat.options import Options
from coneflat.retries import lay_out_with_thick_triangles
from coneflat.source import Source, coarse_component
from coneflat.textures import cut_search
from coneflat.textures.creases import along_sharp_edges
from coneflat.textures.free_seams import freed
from coneflat.textures.small_charts import join_small_charts

CLOSED = {"sphere": shapes.sphere(3), "two handles": shapes.genus(2), "box": shapes.box()}
OPEN = {"hill": shapes.hill(), "annulus": shapes.annulus(), "cylinder": shapes.cylinder()}


@pytest.mark.parametrize("bound", [pytest.param(4.02, marks=pytest.mark.slow), 4.1, 4.5])
@pytest.mark.parametrize("shape", [*CLOSED.values(), *OPEN.values()], ids=[*CLOSED, *OPEN])
def test_the_energy_is_within_the_bound(shape, bound):
    result = unwrap(*shape, max_energy=bound)
    d = result.distortion
    assert not any("allowed" in note for note in result.notes)
    assert 4 - 1e-9 <= d.energy <= bound * (1 + 1e-9)
    assert (d.flipped, d.degenerate, d.overlapping_pairs) == (0, 0, 0)


def test_the_search_goes_on_where_the_first_candidates_have_the_same_cones(monkeypatch):
    monkeypatch.setattr("coneflat.textures.search.FIRST_DISTORTION", 10.0)
    assert unwrap(*shapes.hill(), max_energy=4.01).distortion.energy <= 4.01
    vertices, faces = shapes.hill()
    assert unwrap(vertices * [1, 1, 0.25], faces, max_energy=4.00243).distortion.energy <= 4.00243


@pytest.mark.slow
def test_noise_that_a_coarse_mesh_does_not_have_needs_its_own_cones():
    """The cones of the coarse mesh leave an energy of 4.116, and with sets of the coarse model only, seams are 10.8."""
    result = unwrap(*noisy("noisy-torus"))
    d = result.distortion
    assert (d.energy < 4.1, d.flipped, d.overlapping_pairs, result.notes) == (True, 0, 0, ())
    assert d.seam_length < 9.5


@pytest.mark.slow
@pytest.mark.parametrize("shape", [shapes.sphere(3), shapes.genus(2)], ids=["one chart", "several charts"])
def test_the_exact_metric_need_not_converge(shape, monkeypatch):
    # Whether a cut pays for packing may depend on small differences.
    exact = unwrap(*shape, packing_cuts=0).distortion.seam_length

    def diverge(*_):
        raise errors.ConvergenceError("the exact metric did not converge")

    monkeypatch.setattr("coneflat.metric.solve.ExactSolver.metric", diverge)
    with pytest.raises(errors.ConvergenceError):
        coneflat.flatten(*shape)
    d = unwrap(*shape, packing_cuts=0).distortion
    assert (d.flipped, d.overlapping_pairs) == (0, 0)
    assert d.energy <= 4.1
    assert d.seam_length == pytest.approx(exact, rel=0.05)


@pytest.mark.parametrize("height", [1e-3, 1e-6, 1e-9, 1e-12])
def test_a_triangle_nearly_without_area_does_not_raise_the_energy(height):
    vertices, faces = shapes.sphere(2)
    (a, b, c), apex = faces[0], len(vertices)
    point = (1 - height) * (vertices[a] + vertices[b]) / 2 + height * vertices[c]
    split = np.vstack([faces[1:], [[a, b, apex], [b, c, apex], [c, a, apex]]])
    measures = unwrap(np.vstack([vertices, point]), split).distortion
    assert measures.energy < 4.1
    # The plane has the shape of triangles that are a millionth as high as long, and a thicker one of others.
    assert measures.qc_max < max(20, 1e-5 / height)


@pytest.fixture(scope="module")
def cow(shared):
    """A texture of a model with legs, a tail and horns."""
    return unwrap(shared("spot.obj"))


@pytest.fixture(scope="module")
def fandisk(shared):
    return unwrap(shared("fandisk.obj"))


@pytest.mark.slow
def test_models_have_short_seams_within_the_bound(shared, cow, fandisk):
    for result, bound in (
        (cow, 4.5),
        (unwrap(shared("rocker-arm.obj")), 3.7),
        (fandisk, 3.4),
        (unwrap(shared("fandisk.obj"), charts="one"), 2.8),  # without cuts for packing
    ):
        d = result.distortion
        assert d.energy <= 4.1
        assert d.area_std <= 0.08
        assert (d.flipped, d.overlapping_pairs) == (0, 0)
        assert d.seam_length <= bound


def test_a_smaller_bound_needs_longer_seams():
    lengths = [
        unwrap(*shapes.sphere(3), max_energy=bound).distortion.seam_length for bound in (4.01, 4.05, 4.5)
    ]
    assert lengths[0] > lengths[1] > lengths[2]


def test_freed_seams_lower_the_energy():
    """At equal cones and cut, the layout with tied seams has more energy."""
    tied = coneflat.flatten(*shapes.sphere(3), cone_count=6, stretch=1.0, charts="one")
    source = Source(as_input(tied.vertices, tied.faces))
    cones = dict(zip(tied.cones.tolist(), tied.curvatures.tolist(), strict=True))
    component = source.prepared(Options(cones=cones)).components[0]
    free, energy = freed(lay_out_with_thick_triangles(component, Steps()))
    assert len(free.seams) == len(tied.seams)
    assert 4 < energy < tied.distortion.energy - 1e-3


@pytest.mark.slow
def test_a_flipped_start_is_replaced():
    component = Source(as_input(*shapes.hill())).prepared(Options()).components[0]
    layout = lay_out_with_thick_triangles(component, Steps())
    points = layout.points.copy()
    inner = int(np.flatnonzero(~component.mesh.is_boundary_vertex)[0])
    points[layout.corners[component.mesh.faces == inner][0]] += 100.0
    expected, energy = freed(layout)[1], freed(replace(layout, points=points))[1]
    assert energy == pytest.approx(expected, rel=1e-3)


@pytest.mark.slow
def test_few_flipped_triangles_are_untangled_in_place(monkeypatch):
    """Embedding the whole chart anew takes many more steps."""
    component = Source(as_input(*shapes.hill(20, 20))).prepared(Options()).components[0]
    layout = lay_out_with_thick_triangles(component, Steps())
    expected, points = freed(layout)[1], layout.points.copy()
    at = layout.corners[component.mesh.faces == np.flatnonzero(~component.mesh.is_boundary_vertex)[150]]
    points[at[0]] += 2 * np.ptp(points[layout.corners[(layout.corners == at[0]).any(axis=1)]], axis=(0, 1))
    assert (signed_double_areas(points[layout.corners]) <= 0).any()
    monkeypatch.setattr(import_module("coneflat.optimise.free_seams"), "embedded_disks", None)
    assert freed(replace(layout, points=points))[1] == pytest.approx(expected, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("shape", [shapes.sphere(3), shapes.hill(20, 20)])
def test_scale_motion_and_numbering_change_nothing(shape):
    vertices, faces = shape
    base = unwrap(vertices, faces).distortion
    other_vertices, other_faces, _ = shapes.renumber(vertices, faces)
    for mesh in (
        (vertices * 1e-6, faces),
        (vertices * 1e6, faces),
        (vertices @ shapes.rotation().T, faces),
        (other_vertices, other_faces),
    ):
        measures = unwrap(*mesh).distortion
        assert measures.energy == pytest.approx(base.energy, rel=1e-6)
        assert measures.seam_length == pytest.approx(base.seam_length, rel=1e-6)


def test_the_same_input_gives_the_same_output():
    first, second = unwrap(*shapes.genus(2)), unwrap(*shapes.genus(2))
    np.testing.assert_array_equal(first.uv, second.uv)
    np.testing.assert_array_equal(first.uv_faces, second.uv_faces)


def test_components_have_one_texel_density():
    small, large = shapes.sphere(2), shapes.sphere(3)
    result = unwrap(*shapes.join(small, (large[0] * 5, large[1])))
    scale, split = result.distortion.log_area_scale, len(small[1])
    assert np.median(scale[:split]) == pytest.approx(np.median(scale[split:]), abs=0.05)


def test_a_bound_that_no_cut_reaches_gives_a_note():
    vertices, faces = shapes.hill()
    result = unwrap(vertices, faces, max_energy=4.0001, no_seams=np.arange(len(vertices)))
    assert result.distortion.flipped == 0
    assert "above the 4.0001 allowed" in result.notes[-1]
    noted = float(result.notes[-1].split("up to ")[1].split(",")[0])
    assert noted == pytest.approx(result.distortion.energy, abs=1e-4)


@pytest.mark.parametrize("bound", [4, 3.9, -1, np.nan])
def test_a_bound_of_an_isometry_or_less_is_refused(bound):
    with pytest.raises(errors.OptionError, match="max_energy"):
        unwrap(*shapes.sphere(1), max_energy=bound)


def test_unknown_options_are_refused():
    with pytest.raises(errors.OptionError, match="unknown option distortion"):
        unwrap(*shapes.sphere(1), distortion=0.1)


@pytest.mark.slow
def test_seams_of_the_user_are_cut():
    vertices, faces = shapes.box()
    edges = coneflat.check_mesh(vertices, faces).mesh.edges
    result = unwrap(vertices, faces, seams=edges)
    assert result.distortion.charts == len(faces)
    assert result.distortion.energy == pytest.approx(4.0)


def test_the_command_writes_what_it_reports(tmp_path):
    mesh = shapes.write_obj(tmp_path / "ball.obj", *shapes.sphere(3))
    done = command(
        "unwrap",
        mesh,
        "-o",
        tmp_path / "out.obj",
        "--report",
        tmp_path / "out.json",
        "--require",
        "energy<=4.1",
    )
    assert done.returncode == 0, done.stderr
    assert "energy" in done.stdout
    assert 4 < measure_uv(tmp_path / "out.obj").distortion.energy <= 4.1
    refused = command("unwrap", mesh, "-o", tmp_path / "no.obj", "--max-energy", "4")
    assert refused.returncode == 2
    assert refused.stderr == "coneflat: error: max_energy must be above 4, the energy of an isometry, got 4\n"
    assert not (tmp_path / "no.obj").exists()


def test_the_energy_of_a_stretched_square():
    mesh = coneflat.check_mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]).mesh
    # Singular values 2 and 1: at the best scale (2^2 + 1) s^2 = (1/2^2 + 1) / s^2, and the sum of both is 5.
    for scale in (1e-3, 1.0, 50.0):
        stretched = scale * mesh.vertices[mesh.faces][:, :, :2] * [2, 1]
        assert coneflat.measure(mesh, stretched).energy == pytest.approx(5.0)


@pytest.mark.slow
def test_branching_charts_are_cut_to_fill_the_texture(shared):
    uncut, cut = (unwrap(shared("hand.obj"), packing_cuts=strength) for strength in (0, 1))
    assert cut.packing_efficiency > max(0.65, 1.15 * uncut.packing_efficiency)
    assert cut.distortion.seam_length <= 1.35 * uncut.distortion.seam_length
    assert max(cut.distortion.energy, uncut.distortion.energy) <= 4.1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "coverage", "most_charts"), [("3holes.off", 0.64, 4), ("elephant.obj", 0.7, 6)]
)
def test_charts_with_short_seams_are_cut_as_well(shared, name, coverage, most_charts):
    """Cuts may cost as much as the root of the area, even if the seams are hardly longer."""
    uncut, cut = (unwrap(shared(name), packing_cuts=strength) for strength in (0, 1))
    assert uncut.distortion.charts <= most_charts // 2 < cut.distortion.charts <= most_charts
    assert cut.packing_efficiency > max(coverage, 1.2 * uncut.packing_efficiency)
    assert cut.distortion.seam_length <= uncut.distortion.seam_length + 1.5


@pytest.mark.slow
def test_small_charts_are_joined_to_others_where_they_fit(shared, monkeypatch):
    path, bound = shared("spot.obj"), 4.02
    result = unwrap(path, max_energy=bound, packing_cuts=1)
    monkeypatch.setattr("coneflat.textures.further_cuts.join_small_charts", lambda _, candidate: candidate)
    joined, apart = result.distortion, unwrap(path, max_energy=bound, packing_cuts=1).distortion
    assert joined.charts <= apart.charts - 2
    assert joined.seam_length < 0.99 * apart.seam_length
    assert joined.energy <= bound
    assert (joined.flipped, joined.overlapping_pairs) == (0, 0)
    # What the result says of the cones is measured after their points have moved.
    sides = result.corner_uv[:, [2, 0, 1]] - result.corner_uv[:, [1, 2, 0]]
    angles = np.bincount(result.faces.ravel(), corner_angles(np.linalg.norm(sides, axis=2)).ravel())
    assert result.curvatures == pytest.approx(2 * np.pi - angles[result.cones], abs=1e-6)


@pytest.mark.slow
def test_the_cut_of_a_large_mesh_is_searched_on_a_coarse_one(monkeypatch):
    """The seams are hardly longer than those found on the mesh itself."""
    shape = shapes.torus(120, 40)
    coarse = unwrap(*shape).distortion
    monkeypatch.setattr("coneflat.source.coarse.COARSE", len(shape[1]))
    fine = unwrap(*shape).distortion
    assert max(coarse.energy, fine.energy) <= 4.1
    assert (coarse.flipped, coarse.overlapping_pairs) == (0, 0)
    assert coarse.seam_length <= 1.25 * fine.seam_length


@pytest.mark.slow
@pytest.mark.parametrize("tiles", [1, 3])
def test_the_resolution_follows_from_the_texel_density(tiles):
    result = unwrap(*shapes.torus(), texel_density=200.0, tiles=tiles)
    side = result.settings["resolution"]
    assert side % 4 == 0
    assert 200 <= result.uv_scale * side <= 200 * (1 + 12 / side)
    scaled = unwrap(shapes.torus()[0] * 1e-3, shapes.torus()[1], texel_density=200e3, tiles=tiles)
    assert scaled.settings["resolution"] == side


def test_a_texel_density_that_needs_too_large_a_texture_is_refused():
    with pytest.raises(errors.OptionError, match="texel_density is too large"):
        unwrap(*shapes.torus(), texel_density=1e9)


def test_a_resolution_and_a_texel_density_cannot_be_combined():
    with pytest.raises(errors.OptionError, match="cannot be combined"):
        unwrap(*shapes.box(), texel_density=50.0, resolution=512)


@pytest.mark.parametrize("density", [1e-6, 4.885, 8.869])
def test_a_small_texel_density_is_reached(density):
    result = unwrap(*shapes.box(), texel_density=density)
    assert result.uv_scale * result.settings["resolution"] >= density


def test_a_mesh_that_cannot_be_made_coarse_is_searched_itself(monkeypatch):
    monkeypatch.setattr("coneflat.source.coarse.COARSE", 2)
    assert unwrap(*shapes.torus(16, 8)).distortion.flipped == 0


def test_seams_follow_sharp_edges_where_these_bend_the_surface():
    """A cube cut open along its edges; a sphere has no sharp edges, so its seams cost their lengths."""
    result = unwrap(*shapes.box(8, sides=(1.0, 1.0, 1.0)))
    on_edge = (np.isclose(np.abs(result.vertices - result.vertices.mean(axis=0)), 0.5)).sum(axis=1) >= 2
    ends = result.vertices[result.seams]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    assert lengths[on_edge[result.seams].all(axis=1)].sum() > 0.8 * lengths.sum()
    creases = [
        along_sharp_edges(Source(as_input(*shape)).prepared(Options()).components)[0].seams.creases
        for shape in (shapes.box(), shapes.sphere(3, 0.0))
    ]
    assert creases == [pytest.approx(0.3), 0.0]


def test_a_coarse_component_keeps_what_belongs_to_its_vertices(monkeypatch):
    monkeypatch.setattr("coneflat.source.coarse.COARSE", 300)
    vertices, faces = shapes.hill(20, 20)
    weights = np.arange(1.0, len(vertices) + 1)
    options = Options(forbidden_cones=[3, 50], boundary="lengths", seam_weights=weights)
    component = Source(as_input(vertices, faces)).prepared(options).components[0]
    coarse, vertices_kept = coarse_component(component)
    assert np.array_equal(coarse.vertices, component.vertices[vertices_kept])
    assert np.array_equal(coarse.mesh.vertices, component.mesh.vertices[vertices_kept])
    for coarse_values, fine_values in (
        (coarse.cones.is_allowed, component.cones.is_allowed),
        (coarse.cones.absorbs_curvature, component.cones.absorbs_curvature),
        (coarse.cones.names, component.cones.names),
        (coarse.metric.keeps_length, component.metric.keeps_length),
        (coarse.seams.weights, component.seams.weights),
    ):
        assert np.array_equal(coarse_values, fine_values[vertices_kept])
        assert len(np.unique(coarse_values)) > 1


@pytest.mark.slow
def test_forbidden_edges_that_are_cut_are_counted(shared):
    mesh = coneflat.read_mesh(shared("spot.obj"))
    right = np.flatnonzero(mesh.vertices[:, 0] > np.median(mesh.vertices[:, 0]))
    result = unwrap(mesh, no_seams=right, max_energy=4.35)
    is_cut = np.isin(result.seams, right).all(axis=1).sum()
    noted = [note for note in result.notes if "forbidden edges had to be cut" in note]
    assert len(noted) == 1
    assert int(noted[0].split()[0]) == is_cut > 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "max_length"),
    [("rocker-arm.obj", 1.85), ("fandisk.obj", 1.5), *((name, 2.6) for name in at_hand("elephant.obj"))],
)
def test_the_search_for_a_loose_bound_on_a_coarse_mesh_tries_other_cones(shared, name, max_length):
    """With those of the first search alone, the elephant's seams are longer by a third."""
    assert unwrap(shared(name), max_energy=5.0, packing_cuts=0).distortion.seam_length < max_length


def test_small_charts_inside_another_one_are_joined(monkeypatch):
    """The second join closes edges of the third seam as well."""
    searches = []
    best_cut = cut_search.best_cut
    monkeypatch.setattr(
        cut_search, "best_cut", lambda model: searches.append((model, best_cut(model))) or searches[-1][1]
    )
    # A developable grid would not be searched.
    unwrap(*shapes.grid(40, 40, lambda x, y: 0.003 * np.cos(9 * x) * np.cos(9 * y)))
    ((model, candidate),) = searches
    layout = candidate.layout
    inner = np.flatnonzero(~layout.mesh.is_boundary_vertex)
    offsets = np.abs(layout.mesh.vertices - layout.mesh.vertices.mean(axis=0)).sum(axis=1)
    middle = inner[np.argmin(offsets[inner])]
    around = np.flatnonzero((layout.mesh.faces == middle).any(axis=1))
    chart = layout.chart.copy()
    chart[around], chart[around[0]] = 1, 2
    charts = ChartLayout(layout.points, layout.corners, layout.chart).split(chart).renumbered()
    joined = join_small_charts(model, replace(candidate, layout=with_charts(layout, charts)))
    assert joined.layout.chart.max() == 0
    assert joined.energy == pytest.approx(4)
