"""What the user may say about cones: weights, places, bounds, boundaries."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from click.testing import CliRunner

from coneflat import MeshFile, TriangleMesh, errors, find_cones, flatten, read_mesh
from coneflat.apps.cli.main import cli


def painted_ply(path, vertices, faces, red):
    """Write an ASCII PLY with vertex colours and a quality."""
    head = ["ply", "format ascii 1.0", f"element vertex {len(vertices)}"]
    head += [f"property float {axis}" for axis in "xyz"] + [
        f"property uchar {c}" for c in ("red", "green", "blue")
    ]
    head += ["property float quality", f"element face {len(faces)}", "property list uchar int vertex_indices"]
    rows = [f"{x} {y} {z} {255 if r else 128} {0 if r else 128} {0 if r else 128} {9 if r else 1}"
            for (x, y, z), r in zip(vertices, red, strict=True)]  # fmt: skip
    rows += [f"3 {a} {b} {c}" for a, b, c in faces]
    path.write_text("\n".join([*head, "end_header", *rows]) + "\n")
    return path


def spread(result, where):
    """Return the standard deviation of the log conformal factor over some vertices."""
    return np.std(result.log_scale[where])


@pytest.fixture(scope="module")
def ball():
    vertices, faces = shapes.sphere(3)
    vertices = vertices * [1, 1, 1.6]
    return vertices, faces, vertices[:, 2] > 0.8


@pytest.mark.parametrize("weights", ["quality", "color"])
def test_weights_of_a_file(tmp_path, ball, weights):
    vertices, faces, important = ball
    model = read_mesh(painted_ply(tmp_path / "ball.ply", vertices, faces, important))
    assert isinstance(model, MeshFile)
    assert model.properties["red"].max() == 1
    plain = flatten(model, cone_count=5)
    careful = flatten(model, cone_count=5, weights=weights)
    assert spread(careful, important) < spread(plain, important)


def test_colours_of_an_obj(tmp_path, ball):
    vertices, faces, important = ball
    path = tmp_path / "ball.obj"
    lines = [f"v {x} {y} {z} {int(r)} 0 0" for (x, y, z), r in zip(vertices, important, strict=True)]
    path.write_text("\n".join([*lines, *(f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces)]) + "\n")
    model = read_mesh(path)
    np.testing.assert_array_equal(model.properties["red"], important)
    np.testing.assert_allclose(model.vertices, vertices)
    by_array = flatten(vertices, faces, cone_count=5, weights=np.where(important, 100.0, 1.0))
    np.testing.assert_array_equal(flatten(model, cone_count=5, weights="color").cones, by_array.cones)


def test_required_cones_are_used_and_forbidden_ones_are_not(ball):
    vertices, faces, important = ball
    required = flatten(vertices, faces, required_cones=[5, 77])
    assert {5, 77} <= set(required.cones.tolist())
    forbidden = np.flatnonzero(important)
    assert not np.isin(flatten(vertices, faces, forbidden_cones=forbidden).cones, forbidden).any()


def test_a_required_cone_that_no_seam_can_reach_is_refused():
    vertices, faces = shapes.hill(4, 3)
    mesh = TriangleMesh(vertices, faces)
    inside = mesh.edges[~mesh.is_boundary_edge]
    with pytest.raises(errors.SeamError, match="needed to open the mesh"):
        flatten(vertices, faces, required_cones=[6], no_seams=inside, method="linear")


def test_curvatures_and_numbers_of_cones_are_within_their_bounds(ball):
    vertices, faces, _ = ball
    result = flatten(*shapes.genus(2), min_cone_angle=np.pi, max_cone_angle=3 * np.pi)
    assert result.curvatures.max() <= np.pi + 1e-9
    assert result.curvatures.min() >= -np.pi - 1e-9
    assert (flatten(vertices, faces, positive_only=True).curvatures > 0).all()
    assert len(flatten(vertices, faces, cone_count=7).cones) <= 7
    assert len(flatten(vertices, faces, distortion=0.02, max_cones=5).cones) <= 5


def test_a_straight_boundary():
    vertices, faces = shapes.hill()
    result = flatten(vertices, faces, boundary="straight")
    mesh = TriangleMesh(result.vertices, result.faces)
    corners = result.uv[result.uv_faces] @ [1, 1j]
    angles = np.angle((corners[:, [2, 0, 1]] - corners) / (corners[:, [1, 2, 0]] - corners))
    around = np.bincount(result.faces.ravel(), angles.ravel())
    turns = np.pi - around[mesh.is_boundary_vertex]
    is_corner = np.abs(turns) > 1e-6
    assert 0 < is_corner.sum() <= 12
    assert (turns <= np.pi / 2 + 1e-9).all()
    assert not mesh.is_boundary_vertex[result.cones].any()


def test_cones_that_triangles_cannot_hold_are_avoided():
    """A vertex of three triangles has no room for an angle of 3 pi and more."""
    vertices, faces = shapes.genus(2)
    result = flatten(vertices, faces, cone_count=2, max_cone_angle=None)
    valence = np.bincount(faces.ravel(), minlength=len(vertices))
    assert (2 * np.pi - result.curvatures < valence[result.cones] * np.pi).all()
    assert np.abs(np.nan_to_num(result.curvature_residual)).max() < 1e-9


@pytest.mark.parametrize(
    ("options", "kind", "message"),
    [
        ({"weights": "quality"}, errors.OptionError, "no vertex property 'quality'"),
        ({"weights": np.ones(5)}, errors.OptionError, "162 numbers"),
        ({"weights": -np.ones(162)}, errors.OptionError, "must be nonnegative"),
        ({"weights": ["a"] * 162}, errors.OptionError, "must be numbers"),
        ({"required_cones": [3], "forbidden_cones": [3]}, errors.OptionError, "both"),
        ({"required_cones": [999]}, errors.OptionError, "0 to 161"),
        ({"forbidden_cones": [-1]}, errors.OptionError, "0 to 161"),
        ({"forbidden_cones": range(162)}, errors.CurvatureError, "allowed at 0"),
        ({"forbidden_cones": range(2, 162)}, errors.CurvatureError, "allowed at 2"),
        ({"cone_count": 2}, errors.CurvatureError, "3 or more"),
        ({"cone_count": 2.5}, errors.OptionError, "integer"),
        ({"distortion": 0}, errors.OptionError, "a number above 0"),
        ({"min_cone_angle": -1}, errors.OptionError, "positive"),
        ({"min_cone_angle": 7, "max_cone_angle": 6}, errors.OptionError, "exceed"),
        ({"boundary": "straight", "cones": "greedy"}, errors.OptionError, "sparse"),
    ],
)
def test_invalid_constraints_are_refused(options, kind, message):
    with pytest.raises(kind, match=message):
        flatten(*shapes.sphere(2), **options)


@pytest.fixture
def files(tmp_path, ball):
    vertices, faces, important = ball
    painted_ply(tmp_path / "ball.ply", vertices, faces, important)
    np.savetxt(tmp_path / "weights.txt", np.where(important, 5.0, 1.0))
    (tmp_path / "face.txt").write_text("# not here\n" + "\n".join(map(str, np.flatnonzero(important))) + "\n")
    return tmp_path


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--weights", "quality", "--min-cone-angle", "90deg"], None),
        (["--weights", "weights.txt", "--forbidden-cones", "face.txt", "--required-cones", "3"], None),
        (["--cone-count", "6", "--forbidden-cones", "1,5,9,33,81,160,200,333,401"], None),
        (["--quantise", "pi/2", "--distortion", "0.3"], None),
        (["--quantize", "pi/2", "--hide-seams", "2"], None),
        (["--weights", "nothing"], "it has red, green, blue, quality"),
        (["--forbidden-cones", "a,b"], "'a' is not a vertex"),
        (["--min-cone-angle", "wide"], "is not a valid angle"),
        (["--cone-count", "5", "--distortion", "0.1"], "leave out --distortion"),
        (["--cones", "greedy", "--quantise", "pi/2"], "leave out --quantise"),
        (["--paper", "--distortion", "0.1"], "leave out --distortion"),
        (["--cones", "3", "--weights", "quality"], "leave out --weights"),
    ],
)
def test_on_the_command_line(files, monkeypatch, arguments, told):
    monkeypatch.chdir(files)
    done = CliRunner().invoke(
        cli, ["flatten", "ball.ply", "-o", "out.obj", *arguments], standalone_mode=False
    )
    if told is None:
        assert done.exception is None, done.exception
        assert (files / "out.obj").exists()
    else:
        message = getattr(done.exception, "message", None) or str(done.exception)
        assert told in message


def test_a_constraint_brings_cones_where_the_boundary_is_prescribed():
    vertices, faces = shapes.hill()
    assert len(flatten(vertices, faces, boundary="disk").cones) == 0
    assert len(flatten(vertices, faces, boundary="disk", cone_count=3).cones) == 3


def test_a_distortion_above_the_bound_is_noted():
    vertices, faces = shapes.sphere(3)
    weighted = flatten(vertices, faces, distortion=0.01, max_cones=4, weights=1 + vertices[:, 0] ** 2)
    assert any("above the 0.01 allowed" in note for note in weighted.notes)
    assert not flatten(vertices, faces, distortion=0.5).notes


def test_the_linear_metric_takes_the_cones_of_the_search():
    vertices, faces = shapes.sphere(3)
    solution = find_cones(vertices, faces, distortion=0.1)
    linear = flatten(vertices, faces, distortion=0.1, method="linear")
    assert set(linear.cones) == set(solution.vertices)
    assert not linear.notes


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"cones": "greedy", "weights": np.ones(162)}, "weights is an option of cones 'sparse'"),
        ({"cones": [1, 2, 3], "required_cones": [5]}, "required_cones is an option"),
        ({"required_cones": {1: 0.5}}, "without curvatures"),
        ({"min_cone_angle": "x"}, "min_cone_angle: .x. is not a valid angle"),
        ({"quantise": True}, "quantise must be a number"),
        ({"positive_only": "no"}, "True or False"),
        ({"weights": np.full(162, np.nan)}, "finite"),
    ],
)
def test_options_of_the_wrong_kind(options, message):
    with pytest.raises(errors.OptionError, match=message):
        flatten(*shapes.sphere(2), **options)


def test_no_vertex_is_allowed():
    vertices, faces = shapes.hill()
    assert len(find_cones(vertices, faces, forbidden_cones=range(len(vertices))).vertices) == 0
    assert len(find_cones(vertices, faces, cone_count=2.0).vertices) == 2


class TestRegions:
    """Vertices between which no seam runs, and weights of some vertices."""

    def seams(self, result):
        mesh = TriangleMesh(result.vertices, result.faces)
        sides = mesh.edge_halfedges[~mesh.is_boundary_edge]
        ends = [
            result.uv_faces.reshape(-1)[np.stack([3 * (h // 3) + (h + k) % 3 for k in (1, 2)], axis=-1)]
            for h in sides.T
        ]
        apart = np.any(ends[0] != ends[1][:, ::-1], axis=1)
        return mesh.edges[~mesh.is_boundary_edge][apart]

    def test_no_seam_runs_within_and_no_cone_lies_there(self, ball):
        vertices, faces, region = ball
        plain = flatten(vertices, faces, cone_count=9)
        assert region[plain.cones].any()
        assert region[self.seams(plain)].all(axis=1).any()
        result = flatten(vertices, faces, cone_count=9, no_seams=np.flatnonzero(region))
        assert not region[self.seams(result)].all(axis=1).any()
        mesh = TriangleMesh(vertices, faces)
        inner = np.setdiff1d(np.flatnonzero(region), mesh.edges[region[mesh.edges].sum(axis=1) == 1])
        assert len(inner)
        assert not np.isin(result.cones, inner).any()

    def test_a_belt_keeps_cones_on_its_larger_side(self, ball):
        vertices, faces, _ = ball
        belt = np.abs(vertices[:, 2] - 0.5) < 0.4
        result = flatten(vertices, faces, cone_count=6, no_seams=np.flatnonzero(belt))
        assert (vertices[result.cones, 2] < 0.5).all()
        assert not belt[self.seams(result)].all(axis=1).any()

    def test_a_cone_that_is_given_within_is_refused(self, ball):
        vertices, faces, region = ball
        top = int(np.argmax(vertices[:, 2]))
        with pytest.raises(errors.SeamError, match="forbidden as seams"):
            flatten(vertices, faces, cones=[top, 3, 40], no_seams=np.flatnonzero(region))
        with pytest.raises(errors.OptionError, match="no_seams: 100000 is not a vertex"):
            flatten(vertices, faces, no_seams=[100000])

    def test_what_must_be_cut_all_the_same_is_noted(self):
        # A ramp of two turns lies over itself in the plane, unless it is cut.
        plan, faces = shapes.grid(80, 4)
        turn, radius = 4 * np.pi * plan[:, 0], 1 + 0.5 * plan[:, 1]
        ramp = np.stack([radius * np.cos(turn), radius * np.sin(turn), 0.1 * turn], axis=1)
        result = flatten(ramp, faces, cones="none", charts="atlas", no_seams=range(len(ramp)))
        assert len(result.seams)
        message = f"{len(result.seams)} forbidden edges had to be cut"
        assert any(note.startswith(message) for note in result.notes)
        assert not flatten(ramp, faces, cones="none", charts="one", no_seams=range(len(ramp))).notes

    def test_weights_of_some(self, ball):
        vertices, faces, important = ball
        weights = dict.fromkeys(np.flatnonzero(important).tolist(), 100.0)
        from_array = flatten(vertices, faces, cone_count=5, weights=np.where(important, 100.0, 1.0))
        np.testing.assert_array_equal(
            flatten(vertices, faces, cone_count=5, weights=weights).uv, from_array.uv
        )
        with pytest.raises(errors.OptionError, match="weights: 100000 is not a vertex"):
            flatten(vertices, faces, weights={100000: 2.0})
        with pytest.raises(errors.OptionError, match="that of vertex 3 must be a number"):
            flatten(vertices, faces, weights={3: "x"})

    def test_weights_beside_angles_of_some(self, ball):
        vertices, faces, important = ball
        cones = {3: np.pi / 2, 40: None, 200: None, 300: None, 500: None}
        plain = flatten(vertices, faces, cones=cones)
        careful = flatten(vertices, faces, cones=cones, weights=np.where(important, 100.0, 1.0))
        assert spread(careful, important) < spread(plain, important)


def test_all_copies_of_a_corner_that_repair_splits_are_corners():
    first, second = shapes.grid(3, 3), shapes.grid(3, 3)
    vertices, faces = shapes.join(first, (second[0] + np.array([1.0, 1, 0]), second[1]))
    faces[faces == 16] = 15  # two squares with a common corner
    result = flatten(vertices, faces, boundary=[0, 3, 12, 15, 19, 28, 31], repair=True)
    copies = np.flatnonzero(result.vertex_origin == 15)
    np.testing.assert_allclose(result.prescribed[copies], [np.pi / 2] * 2)
