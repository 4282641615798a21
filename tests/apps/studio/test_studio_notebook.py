"""The studio from Python: its page in a frame of another page, as notebooks have it, its choices and its result."""

from __future__ import annotations

import http.client
import http.server
import re
import urllib.error
import urllib.request

import numpy as np
import pytest
import shapes

import coneflat
from coneflat.errors import ArrayShapeError, MeshFileError, OptionError, StudioError

pytest.importorskip("uvicorn", reason="the extra studio is not installed")
pytest.importorskip("starlette", reason="the extra studio is not installed")


@pytest.fixture
def page():
    with coneflat.studio(*shapes.sphere(3)) as opened:
        yield opened


@pytest.mark.slow
def test_arrays_are_flattened_as_they_are(page):
    result = coneflat.flatten(*shapes.sphere(3), repair=False)
    np.testing.assert_array_equal(page.result.vertices, result.vertices)
    np.testing.assert_array_equal(page.result.uv, result.uv)
    assert page.project.name == "mesh_studio.json"
    assert page.project.exists()


@pytest.mark.slow
def test_choices_are_set_and_read(page):
    assert page.choices["options"] == {}
    page.choices = {"options": {"cone_count": 9}, "paint": {"no_cone": "0-80"}}
    result = page.result
    assert len(result.cones) == 9
    assert (result.cones > 80).all()
    assert page.choices["paint"] == {"no_cone": "0-80"}
    again = coneflat.flatten(*shapes.sphere(3), cone_count=9, forbidden_cones=range(81))
    np.testing.assert_array_equal(result.uv, again.uv)
    page.choices = {**page.choices, "options": {"stretch": 0.5}}
    assert page.choices["options"] == {"stretch": 0.5}
    for bad, message in (
        ({"options": {"stretch": 7}}, "from 0 to 1"),
        ({"cuts": 5}, "expected choices, got"),
        ({"paint": {"glue": "1"}}, "unknown layer 'glue'"),
    ):
        with pytest.raises((StudioError, OptionError), match=message):
            page.choices = bad
    assert page.choices["options"] == {"stretch": 0.5}
    page.choices = {"cuts": [[0, 641]]}
    with pytest.raises(StudioError, match="no edge connects"):
        assert page.result


@pytest.mark.slow
def test_files_and_projects(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shapes.write_obj(tmp_path / "ball.obj", *shapes.sphere(2))
    with coneflat.studio("ball.obj") as first:
        first.choices = {"options": {"charts": "one"}}
        uv = first.result.uv
        assert first.project == tmp_path / "ball_studio.json"
    with coneflat.studio(tmp_path / "ball_studio.json") as second:
        np.testing.assert_array_equal(second.result.uv, uv)
    with coneflat.studio(*shapes.sphere(2), folder=tmp_path) as third:
        assert third.project == tmp_path / "mesh_studio.json"
    assert third.project.exists()
    with pytest.raises(MeshFileError, match="cannot read"):
        coneflat.studio("nowhere.obj")
    with pytest.raises(ArrayShapeError, match="must have the shape"):
        coneflat.studio(np.zeros((3, 2)), np.array([[0, 1, 2]]))
    with pytest.raises(ArrayShapeError, match="integers"):
        coneflat.studio(np.zeros((3, 3)), np.zeros((1, 3)))


def test_through_a_proxy_the_token_alone_opens_it():
    with coneflat.studio(*shapes.sphere(1), through="/proxy/{port}/") as opened:
        port, query = re.fullmatch(r"/proxy/(\d+)/(\?token=.+)", opened.address).groups()
        for query_text, status in ((query, 200), ("", 403), ("?token=wrong", 403)):
            asked = http.client.HTTPConnection("127.0.0.1", int(port))
            asked.request("GET", f"/{query_text}", headers={"Host": "hub.example"})
            assert asked.getresponse().status == status
            asked.close()
    for bad in ("", "/proxy/", "https://hub/user/me/proxy/8000/"):
        with pytest.raises(OptionError, match="an address that contains"):
            coneflat.studio(*shapes.sphere(1), through=bad)


def test_the_command_s_page_is_in_no_frame(page):
    with urllib.request.urlopen(page.address) as answer:
        assert "frame-ancestors http://localhost:*" in answer.headers["content-security-policy"]
        assert answer.headers["x-frame-options"] is None
    with pytest.raises(urllib.error.HTTPError, match="403"):
        urllib.request.urlopen(page.address.split("?")[0])
