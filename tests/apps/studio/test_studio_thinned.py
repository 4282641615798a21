"""A mesh with more triangles than the page shows: all of them go beside those that are shown."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

from coneflat.apps.studio.child import JobRunner, with_all_triangles
from coneflat.apps.studio.choices import Choices
from coneflat.apps.studio.project import file_hash
from coneflat.apps.view.page.content import Model

SHOWN = 4000  # triangles, of 20,480


@pytest.fixture
def ball(tmp_path):
    """A mesh with a vertex that no face uses, so that vertices have other numbers than the page's."""
    vertices, faces = shapes.sphere(5)
    return shapes.write_obj(tmp_path / "ball.obj", np.concatenate([[[9.0, 9, 9]], vertices]), faces + 1)


def into_ball(places):
    """Return places as the page has them."""
    centred = places - (places.min(axis=0) + places.max(axis=0)) / 2
    return centred / np.linalg.norm(centred, axis=1).max()


@pytest.mark.slow
def test_the_whole_mesh_goes_beside_what_is_shown(ball):
    bench = JobRunner()
    job = {"mesh": str(ball), "sha256": file_hash(ball), "choices": Choices().as_plain()}

    def arrays(**options):
        head, body = bench.flatten({**job, **options}, lambda stage, fraction: None, lambda head, body: None)
        types = {"f4": np.float32, "u4": np.uint32, "i4": np.int32}
        return {
            entry["name"]: np.frombuffer(body, types[entry["type"]], entry["count"], entry["offset"])
            for entry in head["head"]["arrays"]
            if entry["type"] in types
        }

    assert "whole_faces" not in arrays()
    shown, vertices, faces = arrays(most=SHOWN), *shapes.sphere(5)
    np.testing.assert_array_equal(shown["whole_faces"].reshape(-1, 3), faces)
    assert shown["whole_places"].reshape(-1, 3) == pytest.approx(into_ball(vertices), abs=1e-6)
    np.testing.assert_array_equal(shown["whole_numbers"], np.arange(len(vertices)) + 1)
    model = Model.of(bench.result)
    head, _ = with_all_triangles({"arrays": []}, b"", model, bench.result)
    assert [entry["name"] for entry in head["arrays"]] == ["whole_places", "whole_faces", "whole_numbers"]
