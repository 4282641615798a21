"""Who may talk to the studio's server, and what it takes."""

from __future__ import annotations

import json
import re
import shutil
import struct
from importlib.resources import files

import numpy as np
import pytest
import shapes

pytest.importorskip("starlette", reason="the extra studio is not installed")
pytest.importorskip("httpx2")
from starlette.testclient import TestClient

from coneflat.apps.studio.server import studio_app
from coneflat.apps.studio.session import Session
from coneflat.seams.costs import CHEAPEST, SHARP, SMOOTH

TOKEN, PORT = "a-token-of-some-length", 8123
BASE = f"http://127.0.0.1:{PORT}"
ASKED = (
    ("GET", "/"),
    ("GET", "/state"),
    ("GET", "/layout"),
    ("POST", "/act"),
    ("POST", "/export/obj"),
    ("POST", "/quads"),
    ("GET", "/quads"),
    ("POST", "/cancel"),
    ("POST", "/mesh"),
)
MAX_UPLOAD = 200_000


@pytest.fixture
def session(tmp_path):
    opened = Session(tmp_path)
    yield opened
    opened.close()


@pytest.fixture
def stranger(session, monkeypatch):
    monkeypatch.setattr("coneflat.apps.studio.server.MAX_UPLOAD_BYTES", MAX_UPLOAD)
    return TestClient(studio_app(session, TOKEN, PORT), base_url=BASE)


@pytest.fixture
def page(stranger):
    stranger.headers["x-coneflat-token"] = TOKEN
    return stranger


@pytest.fixture
def ball(tmp_path_factory):
    path = tmp_path_factory.mktemp("elsewhere") / "ball.obj"
    shapes.write_obj(path, *shapes.sphere(2))
    return path


@pytest.mark.parametrize(("method", "path"), ASKED)
class TestStrangers:
    def test_without_the_token(self, stranger, method, path):
        for headers in (
            {},
            {"x-coneflat-token": "wrong"},
            {"x-coneflat-token": TOKEN + "x"},
            {"cookie": TOKEN},
        ):
            answer = stranger.request(method, path, headers=headers)
            assert answer.status_code == 403
            assert "token" in answer.text

    def test_the_token_in_the_address_opens_the_page_alone(self, stranger, method, path):
        answer = stranger.request(method, f"{path}?token={TOKEN}")
        assert answer.status_code == (200 if path == "/" else 403)

    def test_requests_with_another_host_are_refused(self, page, method, path):
        for host in (
            "evil.example",
            f"evil.example:{PORT}",
            "127.0.0.1:1",
            f"127.0.0.1.evil.example:{PORT}",
            "",
        ):
            answer = page.request(method, path, headers={"host": host})
            assert answer.status_code == 403, host

    def test_requests_with_another_origin_are_refused(self, page, method, path):
        for origin in ("http://evil.example", "null", "http://127.0.0.1:1", f"https://127.0.0.1:{PORT}"):
            answer = page.request(method, path, headers={"origin": origin})
            assert answer.status_code == 403, origin


class TestPage:
    def test_the_page_extends_the_page_of_the_viewer(self, stranger):
        answer = stranger.get(f"/?token={TOKEN}")
        assert "class Renderer" in answer.text
        assert "class Studio" in answer.text
        assert "{{" not in answer.text.replace("${{", "")
        assert TOKEN not in answer.text
        assert answer.headers["referrer-policy"] == "no-referrer"
        assert answer.headers["x-frame-options"] == "DENY"
        assert "connect-src 'self'" in answer.text

    def test_its_own_origin_may_ask(self, page):
        for name in ("127.0.0.1", "localhost"):
            headers = {"origin": f"http://{name}:{PORT}", "host": f"{name}:{PORT}"}
            assert page.get("/state", headers=headers).status_code == 200

    @pytest.mark.slow
    def test_a_mesh_is_dropped_flattened_changed_and_saved(self, page, session, ball, tmp_path):
        assert page.get("/state").json()["mesh"] is None
        assert page.get("/layout").status_code == 400
        assert page.post("/export/obj").status_code == 400
        assert page.post("/mesh?name=ball.obj", content=ball.read_bytes()).status_code == 200
        assert session.wait_until_idle(120)
        state = page.get("/state").json()
        assert (state["mesh"], state["layout"], state["trouble"]) == (
            "ball.obj",
            2,
            None,
        )  # The model alone was the first.
        content = page.get("/layout").content
        size = struct.unpack("<I", content[:4])[0]
        head = json.loads(content[4 : 4 + size])
        last = head["arrays"][-1]
        assert len(content) >= 4 + size + last["offset"] + last["count"]
        assert size % 4 == 0
        assert page.post("/act", json={"do": "remove", "vertex": state["found"][0]}).status_code == 200
        later = page.get(f"/state?after={state['version']}&chosen={state['chosen']}").json()
        assert later["choices"]["by_hand"]
        assert "choices" not in page.get(f"/state?chosen={later['chosen']}").json()
        assert page.post("/export/obj").text.count("\nvt ") > 0
        assert (tmp_path / "ball_studio.json").exists()

    def test_refused_requests_are_answered_with_the_reason(self, page, ball):
        page.post("/mesh?name=ball.obj", content=ball.read_bytes())
        answer = page.post("/act", json={"do": "remove", "vertex": 3})
        assert answer.status_code == 400
        assert "the cones are not found yet" in answer.text
        answer = page.post("/act", json={"do": "lock", "vertex": 10**9, "locked": False})
        assert answer.status_code == 400
        assert "vertex 1000000000 is not a cone" in answer.text
        deep = b'{"do": "cut", "path": ' + b"[" * 900 + b"]" * 900 + b"}"
        for garbled in (b"{", b"[]", b"\xff", b'{"do": NaN}', b"[" * 100_000, b'{"a":' * 100_000, deep):
            assert page.post("/act", content=garbled).status_code == 400
        assert page.post("/export/exe").status_code == 400
        assert page.get("/nowhere").status_code == 404


class TestUploads:
    def test_too_large_a_mesh_is_refused_and_leaves_nothing(self, page, tmp_path):
        answer = page.post("/mesh?name=big.obj", content=b"#" * (MAX_UPLOAD + 1))
        assert answer.status_code == 413
        assert f"{MAX_UPLOAD:,}" in answer.text
        assert list(tmp_path.iterdir()) == []

    def test_an_upload_without_a_stated_size_is_refused_above_the_limit(self, page, tmp_path):
        def endless():
            for _ in range(1000):
                yield b"#" * 1000

        assert page.post("/mesh?name=big.obj", content=endless()).status_code == 413
        assert list(tmp_path.iterdir()) == []

    @pytest.mark.parametrize(
        "name",
        ["../up.obj", "%2e%2e%2fup.obj", "/etc/up.obj", "a/b.obj", ".x.obj", "", "x.exe", "x", "a%00.obj"],
    )
    def test_names_of_uploads_stay_in_the_folder(self, page, tmp_path, name, ball):
        before = set(tmp_path.parent.rglob("*"))
        assert page.post(f"/mesh?name={name}", content=ball.read_bytes()).status_code == 400
        assert set(tmp_path.parent.rglob("*")) == before

    @pytest.mark.parametrize(
        ("name", "stored"),
        [
            ("CON.obj", "_CON.obj"),
            ("com1.v2.obj", "_com1.v2.obj"),
            ("a\u202ejbo.obj", "ajbo.obj"),
            ("a\u200b\tb.obj", "ab.obj"),
            ("a:b?.obj", "a_b_.obj"),
            ("bücher 3d.obj", "bücher 3d.obj"),
        ],
    )
    def test_odd_names_are_made_safe(self, page, ball, tmp_path, name, stored):
        assert page.post("/mesh", params={"name": name}, content=ball.read_bytes()).status_code == 200
        assert page.get("/state").json()["mesh"] == stored
        assert (tmp_path / stored).exists()
        assert page.post("/mesh", params={"name": "\u202e.obj"}, content=ball.read_bytes()).status_code == 400

    def test_no_file_is_overwritten(self, page, ball, tmp_path):
        (tmp_path / "ball.obj").write_text("# mine\n")
        assert page.post("/mesh?name=ball.obj", content=ball.read_bytes()).status_code == 200
        assert (tmp_path / "ball.obj").read_text() == "# mine\n"
        assert page.get("/state").json()["mesh"] == "ball-2.obj"
        # The same once more is the same file.
        assert page.post("/mesh?name=ball.obj", content=ball.read_bytes()).status_code == 200
        assert page.get("/state").json()["mesh"] == "ball-2.obj"


def test_the_page_costs_edges_as_seams_do():
    """Cuts are drawn along the paths that seams would take."""
    script = files("coneflat.apps.studio.page").joinpath("graph.js").read_text("utf-8")
    numbers = re.search(
        r"const \[SMOOTH, SHARP, CHEAPEST\] = \[Math.PI / (\d+), Math.PI / (\d+), ([.\d]+)\]", script
    )
    assert numbers is not None
    smooth, sharp, cheapest = map(float, numbers.groups())
    np.testing.assert_allclose([np.pi / smooth, np.pi / sharp, cheapest], [SMOOTH, SHARP, CHEAPEST])


class TestFailedOpening:
    """What is shown stays, and no file is left, if a dropped file cannot be opened."""

    @pytest.mark.slow
    def test_invalid_uploads_change_no_state_and_leave_no_file(self, page, session, ball, tmp_path):
        assert page.post("/mesh?name=ball.obj", content=ball.read_bytes()).status_code == 200
        assert session.wait_until_idle(120)
        before, files_before = page.get("/state").json(), sorted(tmp_path.iterdir())
        for name, content in (
            ("garbage.obj", b"\x00\x01 nonsense"),
            ("empty.obj", b""),
            ("faceless.obj", b"v 0 0 0\n"),
            ("cut.glb", b"glTF\x02\x00\x00\x00"),
            ("other.json", b"{}"),
        ):
            assert page.post(f"/mesh?name={name}", content=content).status_code == 400, name
            assert page.get("/state").json() == before, name
            assert sorted(tmp_path.iterdir()) == files_before, name

    def test_a_file_that_was_there_is_not_removed(self, page, tmp_path):
        (tmp_path / "mine.obj").write_bytes(b"v 0 0 0\n")
        assert page.post("/mesh?name=mine.obj", content=b"v 0 0 0\n").status_code == 400
        assert (tmp_path / "mine.obj").exists()

    def test_a_folder_that_is_gone(self, page, session, ball):
        content = ball.read_bytes()
        shutil.rmtree(session.folder)
        answer = page.post("/mesh?name=other.obj", content=content)
        assert answer.status_code == 400
        assert "other.obj cannot be stored: No such file or directory" in answer.text


@pytest.mark.slow
def test_a_refused_export_replaces_no_reason(page, session, ball):
    page.post("/mesh?name=ball.obj", content=ball.read_bytes())
    assert session.wait_until_idle(120)
    for vertex in page.get("/state").json()["found"]:
        page.post("/act", json={"do": "remove", "vertex": vertex})
    assert session.wait_until_idle(120)
    reason = page.get("/state").json()["trouble"]["text"]
    assert "needs cones to absorb it" in reason
    answer = page.post("/export/obj")
    assert answer.status_code == 400
    assert "there is nothing to save" in answer.text
    assert page.get("/state").json()["trouble"]["text"] == reason
