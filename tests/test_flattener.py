"""One mesh flattened again and again: the same as each time anew, to the last bit."""

from __future__ import annotations

from itertools import count

import numpy as np
import pytest
import shapes

import coneflat
from coneflat import errors
from coneflat.base.progress import cancel_with
from coneflat.cones.sparse import green
from coneflat.linalg import factorize
from coneflat.mesh.connectivity import label_faces


def assert_same(result, expected):
    for name in ("uv", "uv_faces", "cones", "curvatures", "log_scale", "seams"):
        np.testing.assert_array_equal(getattr(result, name), getattr(expected, name), name)
    assert result.distortion.qc_mean == expected.distortion.qc_mean
    assert result.notes == expected.notes


def wavy(resolution=3):
    """A sphere that is not round, so that cones have something to choose."""
    vertices, faces = shapes.sphere(resolution)
    return vertices * (1 + 0.25 * np.sin(3 * vertices[:, :1] + 1) * np.cos(2 * vertices[:, 1:2])), faces


def two_parts():
    hill = shapes.hill(12, 12)
    return shapes.join(wavy(2), (hill[0] + 5, hill[1]))


#: One after the other: places alone, some angles, all, a search, weights, seams, other borders, none of it.
ASKED = (
    {"cone_count": 4, "required_cones": [5, 60, 140, 300]},
    {"cones": {5: 3.0, 61: None, 140: None, 300: None}},
    {"cones": {5: np.pi, 61: np.pi, 141: np.pi, 300: np.pi}},
    {"cone_count": 5},
    {"weights": np.linspace(1, 4, 642)},
    {"weights": np.linspace(2, 1, 642), "required_cones": [5, 61]},
    {"seams": [[0, 12]], "no_seams": [[0, 44]]},
    {"hide_seams": 1.0, "charts": "one"},
    {"method": "linear", "cones": {5: 3.0, 61: None, 140: None, 300: None}},
    {"distortion": 0.1},
)


def test_results_equal_those_of_flatten():
    mesh = wavy()
    edges = coneflat.TriangleMesh(*mesh).edges
    flattener = coneflat.Flattener(*mesh)
    for asked in ASKED:
        asked = dict(asked)
        for name, at in (("seams", 3), ("no_seams", 400)):
            if name in asked:
                asked[name] = edges[at : at + 1]
        assert_same(flattener.flatten(**asked), coneflat.flatten(*mesh, **asked))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mesh", "asked"),
    [
        (shapes.hill(14, 14), [{"cones": {100: 0.5}}, {"boundary": "disk"}, {"cones": {101: 0.5, 40: None}}]),
        (two_parts(), [{"cone_count": 4}, {"cones": {5: None, 60: 3.0, 140: None}}, {"sharp_angle": 1.0}]),
        (shapes.torus(20, 10), [{}, {"quantise": np.pi / 2}, {"cones": {3: 0.5, 90: None}}]),
    ],
)
def test_results_equal_those_of_flatten_with_boundaries_components_and_handles(mesh, asked):
    flattener = coneflat.Flattener(mesh)
    for _ in range(2):
        for options in asked:
            assert_same(flattener.flatten(**options), coneflat.flatten(mesh, **options))


def test_many_moves_factorize_the_mesh_once(monkeypatch):
    made = []

    def counted(matrix):
        made.append(matrix)
        return factorize(matrix)

    monkeypatch.setattr(green, "factorize", counted)
    mesh = wavy()
    flattener = coneflat.Flattener(*mesh)
    for step in range(6):
        cones = {5: 3.0, 60 + step: None, 140: None, 300 - step: None}
        flattener.flatten(cones=cones)
        flattener.flatten(cone_count=len(cones), required_cones=list(cones))
    assert len(made) == 1


def test_other_seams_clear_the_cache():
    mesh = wavy()
    edges = coneflat.TriangleMesh(*mesh).edges
    flattener = coneflat.Flattener(*mesh)
    flattener.flatten()
    (first,) = flattener._surfaces.values()
    flattener.flatten(distortion=0.1)
    assert set(flattener._surfaces.values()) == {first}
    for k in range(3):  # which open it elsewhere each time
        flattener.flatten(seams=edges[10 * k : 10 * k + 2])
        assert first not in flattener._surfaces.values()
        assert len(flattener._surfaces) == 1
    assert all(surface._search is None for surface in flattener._surfaces.values())


class Enough(Exception):
    pass


@pytest.mark.parametrize(("how", "step"), [("told", 12), ("asked", 2)])
def test_cancelled_calls_do_not_change_later_results(how, step):
    mesh, asked = wavy(), {"cones": {5: 3.0, 60: None, 140: None, 300: None}}
    expected = coneflat.flatten(*mesh, **asked)
    flattener = coneflat.Flattener(*mesh)
    interrupted = 0
    for stop in range(1, 200, step):
        calls = count(1)

        def interrupt(*_, calls=calls, stop=stop):
            if next(calls) == stop:
                raise Enough

        options = {"cone_count": 3, "required_cones": [5, 60 + stop, 300]}
        try:
            if how == "told":
                flattener.flatten(**options, progress=interrupt)
            else:
                with cancel_with(interrupt):
                    flattener.flatten(**options)
        except Enough:
            interrupted += 1
            assert_same(flattener.flatten(**asked), expected)
        else:
            break
    assert interrupted > 1


def test_the_preview_precedes_relaxing():
    mesh, told, early = two_parts(), [], []

    def show(first):
        early.append(first)
        told.append("shown")

    flattener = coneflat.Flattener(mesh)
    result = flattener.flatten(on_preview=show, stretch=0.3, progress=lambda stage, _: told.append(stage))
    assert_same(result, coneflat.flatten(mesh, stretch=0.3))
    (first,) = early
    assert told.index("shown") < told.index("relax")
    np.testing.assert_array_equal(first.cones, result.cones)
    parts = coneflat.TriangleMesh(*mesh).components[0]
    assert label_faces(first.uv_faces, len(first.uv))[0] == parts
    # Nobody has looked for its overlaps: it does not say that there are none.
    assert np.isnan(first.distortion.overlap)
    assert first.distortion.flipped == 0


def test_invalid_meshes_and_options_are_errors():
    with pytest.raises(errors.ArrayShapeError):
        coneflat.Flattener(object())
    flattener = coneflat.Flattener(*shapes.sphere(1))
    with pytest.raises(errors.OptionError, match="no_such"):
        flattener.flatten(no_such=1)
    with pytest.raises(errors.CurvatureError, match="must sum to"):
        flattener.flatten(cones={0: 1.0})
    assert_same(flattener.flatten(), coneflat.flatten(*shapes.sphere(1)))
