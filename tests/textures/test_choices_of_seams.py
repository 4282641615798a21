"""What decides on the seams of a texture, instead of a bound of the energy."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
import shapes
from command import command

import coneflat
from coneflat import errors, measure_uv, unwrap
from coneflat.options import read_options
from coneflat.textures.options import UnwrapOptions

CLOSED = {"torus": shapes.torus(), "two handles": shapes.genus(2)}
OPEN = {"hill": shapes.hill(), "annulus": shapes.annulus()}


def is_valid(result):
    d = result.distortion
    return (d.flipped, d.degenerate, d.overlapping_pairs) == (0, 0, 0)


def ends(edges):
    """The vertices at which only one of the edges ends."""
    vertices, degree = np.unique(edges, return_counts=True)
    return vertices[degree == 1]


def plus(arm=8, width=4):
    """A flat plus of squares."""
    size = 2 * arm + width
    vertices, faces = shapes.grid(size, size)
    middle = (
        vertices[faces].mean(axis=1)[:, :2]
        - np.ptp(vertices[:, :2], axis=0) / 2
        - vertices[:, :2].min(axis=0)
    )
    cell = np.ptp(vertices[:, 0]) / size
    vertices_used, faces = np.unique(
        faces[(np.abs(middle) < width / 2 * cell).any(axis=1)], return_inverse=True
    )
    return vertices[vertices_used], faces.reshape(-1, 3), width * cell


def test_a_disk_needs_no_seams():
    result = unwrap(*shapes.hill(), seams="none")
    assert is_valid(result)
    assert (len(result.seams), result.distortion.charts) == (0, 1)


def test_a_sphere_needs_one_seam_whatever_the_energy():
    result = unwrap(*shapes.sphere(3), seams="none")
    assert is_valid(result)
    assert result.distortion.energy > 4.1
    assert result.distortion.seam_length < 0.7 * unwrap(*shapes.sphere(3)).distortion.seam_length
    count, _ = coneflat.TriangleMesh(result.vertices, result.faces).boundary_loops
    assert count == 0
    # A tree has one edge less than vertices.
    assert len(np.unique(result.seams)) == len(result.seams) + 1


@pytest.mark.slow
@pytest.mark.parametrize("shape", CLOSED.values(), ids=CLOSED)
def test_handles_need_closed_curves_only(shape):
    result = unwrap(*shape, seams="none", charts="one")
    assert len(ends(result.seams)) == 0
    assert result.distortion.flipped == 0
    # The cut has the Euler characteristic of the surface minus that of a disk.
    characteristic = coneflat.TriangleMesh(*shape).euler_characteristic
    assert len(np.unique(result.seams)) - len(result.seams) == characteristic - 1
    assert result.distortion.seam_length < unwrap(*shape).distortion.seam_length


def test_overlaps_are_separated_also_without_seams():
    result = unwrap(*shapes.genus(5), seams="none")
    assert is_valid(result)


def test_no_seams_beyond_the_marked_ones():
    vertices, faces = shapes.hill()
    edges = coneflat.TriangleMesh(vertices, faces).edges
    across = edges[np.isclose(vertices[edges][:, :, 0], np.unique(vertices[:, 0])[12]).all(axis=1)]
    result = unwrap(vertices, faces, seams=("none", across))
    assert result.distortion.charts == 2
    assert sorted(map(tuple, np.sort(result.seams, axis=1))) == sorted(map(tuple, np.sort(across, axis=1)))
    assert result.settings["seams"] == ["none", across.tolist()]
    assert not any("sides of seams" in note for note in result.notes)


@pytest.mark.slow
@pytest.mark.parametrize("shape", [shapes.sphere(3), shapes.hill(), shapes.genus(2)])
def test_there_are_as_many_charts_as_requested(shape):
    few = unwrap(*shape, charts=1)
    for count in (2, 3, 7, 20):
        result = unwrap(*shape, charts=count)
        assert is_valid(result), count
        assert result.distortion.energy <= 4.1, count
        assert result.distortion.charts == max(count, few.distortion.charts)
        assert any("instead of" in note for note in result.notes) == (count < few.distortion.charts), count


def test_slivers_are_no_charts_that_are_requested(shared):
    """Overlaps leave charts of few triangles, which are joined to others."""
    result = unwrap(shared("spot.obj"), max_energy=4.02, charts=12)
    corners = result.vertices[result.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.bincount(result.seam_data.face_chart, np.linalg.norm(normals, axis=1))
    assert is_valid(result)
    assert result.distortion.charts == 12
    assert areas.min() > 0.005 * areas.sum()


def test_charts_are_counted_over_all_components():
    component = shapes.sphere(2)
    result = unwrap(*shapes.join(component, (component[0] + 5, component[1])), charts=7)
    assert result.distortion.charts == 7


def test_charts_are_cut_where_they_are_narrow():
    """A plus has four arms and a middle; four cuts across arms are the shortest that make large pieces."""
    vertices, faces, width = plus()
    result = unwrap(vertices, faces, charts=5)
    lengths = np.linalg.norm(np.diff(vertices[result.seams], axis=1)[:, 0], axis=1)
    assert result.distortion.charts == 5
    assert lengths.sum() <= 1.2 * 4 * width
    sizes = np.bincount(result.seam_data.face_chart)
    assert sizes.min() >= 0.1 * len(faces)


def test_more_charts_than_can_be_cut_give_a_note():
    result = unwrap(*shapes.box(1), charts=100)
    assert is_valid(result)
    chart_count = int(re.search(r"has (\d+) charts instead of 100: no further cut", result.notes[-1])[1])
    assert chart_count == result.distortion.charts < 100


def test_fewer_charts_than_components_give_a_note():
    result = unwrap(*shapes.join(shapes.sphere(2), (shapes.sphere(2)[0] + 5, shapes.sphere(2)[1])), charts=1)
    assert result.distortion.charts == 2
    assert result.notes[-1].startswith("The texture has 2 charts instead of 1: components")


@pytest.mark.slow
@pytest.mark.parametrize("bound", [0.02, 0.06, 0.15])
@pytest.mark.parametrize(
    "shape",
    [
        shapes.sphere(3),
        shapes.genus(2),
        shapes.hill(),
        shapes.join(shapes.sphere(2), (shapes.torus()[0] * 3 + 5, shapes.torus()[1])),
    ],
    ids=["sphere", "two handles", "hill", "two components"],
)
def test_the_area_distortion_is_within_its_bound(shape, bound):
    result = unwrap(*shape, area=bound)
    assert is_valid(result)
    assert result.distortion.area_std <= bound
    assert not any("allowed" in note for note in result.notes)


@pytest.mark.slow
def test_a_smaller_area_distortion_needs_longer_seams():
    lengths = [unwrap(*shapes.sphere(3), area=bound).distortion.seam_length for bound in (0.02, 0.06, 0.15)]
    assert lengths[0] > lengths[1] > lengths[2]


def test_an_area_distortion_that_no_cut_reaches_gives_a_note():
    vertices, faces = shapes.hill()
    result = unwrap(vertices, faces, area=1e-4, no_seams=np.arange(len(vertices)))
    assert result.notes[-1].startswith("The area distortion of 1 component is up to ")
    reached = float(result.notes[-1].split("up to ")[1].split(",")[0])
    assert reached == pytest.approx(result.distortion.area_std, rel=0.05)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"area": 0.1, "max_energy": 4.2}, "area and max_energy cannot be combined"),
        ({"seams": "none", "area": 0.1}, "seams none and area cannot be combined"),
        ({"seams": ("none", [(0, 1)]), "max_energy": 4.2}, "seams none and max_energy cannot be combined"),
        ({"stack": "mirrored", "lengths": np.ones((1, 3))}, "stack mirrored and lengths cannot be combined"),
        ({"packing_cuts": -0.1}, "packing_cuts must be a number from 0 to 1, got -0.1"),
        ({"packing_cuts": 1.5}, "packing_cuts must be a number from 0 to 1, got 1.5"),
        ({"packing_cuts": np.nan}, "packing_cuts must be a number from 0 to 1, got nan"),
        ({"packing_cuts": "few"}, "packing_cuts must be a number, got 'few'"),
        ({"area": 0.0}, "area must be a number from 1e-06 to 100, got 0"),
        ({"charts": 0}, "charts must be atlas, one or an integer from 1 to 10,000, got 0"),
        ({"charts": 2.5}, "charts must be an integer, got 2.5"),
        ({"charts": "many"}, "charts must be atlas, one or an integer from 1 to 10,000, got 'many'"),
        ({"seams": "all"}, "unknown seams 'all': choose from input, none"),
        ({"stack": "copied"}, "unknown stack 'copied': choose from none, mirrored"),
    ],
)
def test_contradictory_options_are_refused(options, message):
    with pytest.raises(errors.OptionError, match=message):
        read_options(options, UnwrapOptions)


@pytest.mark.slow
@pytest.mark.parametrize("options", [{"seams": "none"}, {"charts": 4}, {"area": 0.06}])
def test_scale_motion_and_numbering_change_nothing(options):
    vertices, faces = shapes.sphere(3)
    base = unwrap(vertices, faces, **options).distortion
    other_vertices, other_faces, _ = shapes.renumber(vertices, faces)
    for mesh in (
        (vertices * 1e6, faces),
        (vertices @ shapes.rotation().T, faces),
        (other_vertices, other_faces),
    ):
        measures = unwrap(*mesh, **options).distortion
        assert measures.energy == pytest.approx(base.energy, rel=1e-6)
        assert measures.seam_length == pytest.approx(base.seam_length, rel=1e-6)


@pytest.mark.slow
def test_commands_accept_the_choices_of_seams(tmp_path):
    mesh = shapes.write_obj(tmp_path / "ball.obj", *shapes.sphere(2))
    done = command(
        "unwrap", mesh, "-o", tmp_path / "six.glb", "--charts", "6", "--report", tmp_path / "six.json"
    )
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "six.json").read_text())["charts"] == 6
    done = command("unwrap", mesh, "-o", tmp_path / "none.obj", "--seams", "none")
    assert done.returncode == 0, done.stderr
    assert measure_uv(tmp_path / "none.obj").distortion.energy > 4.1
    done = command("batch", mesh, "--out", tmp_path / "flat", "--area", "0.05", "--jobs", "1")
    assert done.returncode == 0, done.stderr
    assert measure_uv(tmp_path / "flat" / "ball.obj").distortion.area_std <= 0.05
