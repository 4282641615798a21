"""Laws of surfaces with few vertices: what needs no cone gets no seam, and a polyhedron opens where that is better."""

import numpy as np
import pytest
import shapes
from stored_meshes import regression

import coneflat
from coneflat import xatlas
from coneflat.base.notes import Unmet, counted_notes

BOUND = 0.2


def sheet(size, height, waves=1.3):
    """Return a curved sheet of size x size vertices."""
    x, y = np.meshgrid(np.arange(size, dtype=float), np.arange(size, dtype=float))
    z = height * np.sin(waves * x) * np.cos(0.7 * waves * y)
    corner = (np.arange(size - 1)[:, None] * size + np.arange(size - 1)).ravel()
    first = np.stack([corner, corner + 1, corner + size + 1], axis=1)
    second = np.stack([corner, corner + size + 1, corner + size], axis=1)
    return np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1), np.concatenate([first, second])


SHEETS = [(size, height) for size in (3, 4, 5, 6) for height in (0.003, 0.1, 0.5)]


@pytest.mark.parametrize(("size", "height"), SHEETS)
def test_a_sheet_that_needs_no_cone_is_flattened_without_a_seam(size, height):
    mesh = sheet(size, height)
    assert coneflat.flatten(*mesh, cones="none").distortion.area_std <= BOUND
    result = coneflat.flatten(*mesh)
    assert (len(result.cones), result.distortion.charts, result.distortion.seam_length) == (0, 1, 0)
    assert result.distortion.area_std <= BOUND


@pytest.mark.parametrize(("size", "height"), SHEETS)
def test_a_sheet_within_the_energy_bound_is_unwrapped_without_a_seam(size, height):
    mesh = sheet(size, height)
    measures = coneflat.unwrap(*mesh).distortion
    assert (measures.charts, measures.seam_length) == (1, 0)
    assert measures.energy <= 4.1


def test_the_drop_in_has_one_chart_for_a_sheet():
    atlas = xatlas.Atlas()
    atlas.add_mesh(*sheet(5, 0.003))
    atlas.generate()
    assert atlas.chart_count == 1


def test_searched_cones_replace_corners_that_hardly_matter():
    # A flat bipyramid: its apices have a curvature of 0.01 pi, its rim has the rest.
    turn = np.arange(6) * np.pi / 3
    rim = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    vertices = np.concatenate([rim, [[0, 0, 0.05], [0, 0, -0.05]]])
    faces = [(i, (i + 1) % 6, 6) for i in range(6)] + [((i + 1) % 6, i, 7) for i in range(6)]
    result = coneflat.flatten(vertices, faces)
    assert len(result.cones) == 6
    assert result.distortion.qc_mean < 1.01


class TestPolyhedra:
    @staticmethod
    def cylinder(sides):
        """Return a closed cylinder of radius 1 and height 2, without vertices inside its faces but two centres."""
        turn = 2 * np.pi * np.arange(sides) / sides
        circle = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
        vertices = np.concatenate([circle, circle + np.array([0, 0, 2]), [[0, 0, 0], [0, 0, 2]]])
        ring, next_ring = np.arange(sides), (np.arange(sides) + 1) % sides
        bottom = np.stack([next_ring, ring, 0 * ring + 2 * sides], axis=1)
        top = np.stack([ring + sides, next_ring + sides, 0 * ring + 2 * sides + 1], axis=1)
        wall = [
            np.stack([ring, next_ring, next_ring + sides], axis=1),
            np.stack([ring, next_ring + sides, ring + sides], axis=1),
        ]
        return vertices, np.concatenate([bottom, top, *wall])

    @pytest.mark.parametrize("sides", [6, 20, 64])
    def test_coarse_polyhedra_open_at_all_corners_where_searched_cones_distort_them(self, sides):
        result = coneflat.flatten(*self.cylinder(sides))
        assert len(result.cones) == 2 * sides
        assert result.distortion.qc_max < 1 + 1e-6
        assert result.distortion.area_std < 1e-6
        assert not result.notes

    def test_a_plate_with_windows_opens_without_distortion(self):
        vertices, faces, _ = regression("plate-with-windows")
        result = coneflat.flatten(vertices, faces)
        assert result.distortion.qc_max < 1 + 1e-6
        assert not result.notes

    def test_a_part_with_more_corners_than_cones_is_cut_along_sharp_edges_with_a_note(self):
        result = coneflat.flatten(*self.cylinder(128))
        assert result.distortion.qc_max < 1 + 1e-6
        assert result.distortion.charts == 3
        assert result.distortion.seam_mismatch_max < 1e-9
        assert len(result.notes) == 1
        assert result.notes[0].startswith("Edges above 40 degrees are seams in the component of vertex 0")

    def test_one_chart_is_not_cut_along_sharp_edges(self):
        result = coneflat.flatten(*self.cylinder(128), charts="one")
        assert result.distortion.charts == 1

    @pytest.mark.slow
    def test_noise_is_not_cut_along_all_sharp_edges(self):
        result = coneflat.flatten(*noisy_ball(), distortion=0.05)
        assert result.distortion.charts < 20


def noisy_ball():
    """Return a sphere with more corners than cones are searched for, and noise of a third of the radius."""
    vertices, faces = shapes.sphere(3)
    return vertices * np.random.default_rng(0).uniform(0.7, 1.3, len(vertices))[:, None], faces


@pytest.mark.slow
def test_the_distortion_that_a_note_advises_to_allow_is_met():
    (note,) = [note for note in coneflat.flatten(*noisy_ball(), distortion=0.05).notes if "allow " in note]
    advised = float(note.split(": allow ")[1].split(",")[0].rstrip("."))
    followed = coneflat.flatten(*noisy_ball(), distortion=advised)
    assert followed.distortion.area_std <= 1.02 * advised
    assert not any("allow " in note for note in followed.notes)


@pytest.mark.slow
def test_smaller_triangles_lower_a_high_angle_distortion_as_a_note_says():
    ball = noisy_ball()
    options = {"distortion": 0.05, "charts": "one"}
    assert any(
        "smaller triangles would lower it" in note for note in coneflat.flatten(*ball, **options).notes
    )
    refined = shapes.subdivide(*shapes.subdivide(*ball))
    assert not any("smaller triangles" in note for note in coneflat.flatten(*refined, **options).notes)


def test_similar_notes_of_components_are_one_note_with_a_count():
    note, plain_note = Unmet("2 cones at vertex 3 (1.5 pi) are missed."), "Cut at 3 edges."
    counted = counted_notes([[note], [Unmet("7 cones at vertex 91 (0.25 pi) are missed."), plain_note], []])
    assert counted == [
        "2 cones at vertex 3 (1.5 pi) are missed (and similarly 1 component more).",
        plain_note,
    ]
    assert isinstance(counted[0], Unmet)
    assert not isinstance(counted[1], Unmet)
