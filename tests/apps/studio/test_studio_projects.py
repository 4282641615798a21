"""Projects that several programs open or change, and projects of meshes that have changed."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest
import shapes

import coneflat
from coneflat.apps.studio.carry import COVERED, MAX_SHIFT, carried_over
from coneflat.apps.studio.choices import Choices
from coneflat.apps.studio.lock import lock_path
from coneflat.apps.studio.paint import Region
from coneflat.apps.studio.places import Places, file_edges, shape_of
from coneflat.apps.studio.project import Project, file_hash, open_project, project_path, read_project
from coneflat.apps.studio.session import Session
from coneflat.errors import ProjectError

#: A studio in another process, which prints a line when the mesh is open.
OTHER_STUDIO = """
import sys, time
from pathlib import Path
from coneflat.apps.studio.session import Session
session = Session(Path(sys.argv[1]).parent, address="http://elsewhere/?token=t")
session.open(Path(sys.argv[1]))
print("open", flush=True)
time.sleep(600)
"""


def add_cone(session, vertex):
    session.act({"do": "lock", "vertex": vertex, "locked": True})


class TestLock:
    def test_a_second_studio_is_told_of_the_first(self, tmp_path, mesh):
        first, second = Session(tmp_path, address="http://here/?token=secret"), Session(tmp_path)
        try:
            first.open(mesh)
            add_cone(first, 7)
            with pytest.raises(ProjectError, match=r"open in another studio: http://here/\?token=secret"):
                second.open(mesh)
            with pytest.raises(ProjectError, match="open in another studio"):
                second.open(first.project_file)
            assert [cone.vertex for cone in read_project(first.project_file).choices.cones] == [7]
            first.close()
            second.open(mesh)
            assert [cone["vertex"] for cone in second.state()["choices"]["cones"]] == [7]
        finally:
            first.close()
            second.close()
        assert not lock_path(second.project_file).exists()

    def test_the_lock_follows_the_mesh_that_is_open(self, session, tmp_path):
        project = session.project_file
        session.open(shapes.write_obj(tmp_path / "other.obj", *shapes.sphere(1)))
        session.open(tmp_path / "other.obj")
        second = Session(tmp_path)
        try:
            with pytest.raises(ProjectError, match="is open in another studio"):
                second.open(tmp_path / "other.obj")
            second.open(project)
            # A mesh that cannot be opened changes no lock.
            (tmp_path / "bad.json").write_text("{}")
            with pytest.raises(ProjectError, match="is not a project"):
                second.open(tmp_path / "bad.json")
            with pytest.raises(ProjectError, match="is open in another studio"):
                session.open(project)
        finally:
            second.close()
        assert {path.name for path in tmp_path.glob(".*.lock")} == {".other_studio.json.lock"}

    @pytest.mark.skipif(sys.platform == "win32", reason="processes end without cleaning up on POSIX alone")
    def test_the_lock_of_a_killed_process_is_free(self, tmp_path, mesh):
        with subprocess.Popen(
            [sys.executable, "-c", OTHER_STUDIO, str(mesh)], stdout=subprocess.PIPE, text=True
        ) as process:
            session = Session(tmp_path)
            try:
                assert process.stdout.readline() == "open\n"
                with pytest.raises(ProjectError, match="http://elsewhere/"):
                    session.open(mesh)
                process.send_signal(signal.SIGKILL)
                process.wait(60)
                path = lock_path(tmp_path / "ball_studio.json")
                assert json.loads(path.read_text())["address"] == "http://elsewhere/?token=t"
                session.open(mesh)
            finally:
                process.kill()
                session.close()
        assert not path.exists()

    def test_a_file_of_a_machine_that_was_restarted_locks_nothing(self, tmp_path, mesh):
        lock_path(tmp_path / "ball_studio.json").write_text('{"address": "http://old/", "machine": "m"}')
        session = Session(tmp_path)
        try:
            session.open(mesh)
        finally:
            session.close()


class TestRevision:
    def test_a_project_that_another_program_has_changed_is_not_overwritten(self, session, tmp_path):
        add_cone(session, 7)
        file = session.project_file
        text = file.read_text().replace("7", "8")
        file.write_text(text)
        session.act({"do": "texture", "value": True})
        assert file.read_text() == text
        assert session.project_file.name == "ball_studio-2.json"
        assert [cone.vertex for cone in read_project(session.project_file).choices.cones] == [7]
        state = session.state()
        assert state["project"] == "ball_studio-2.json"
        assert "Another program has changed ball_studio.json" in state["warnings"][0]
        # The next step is saved there, too, and there is no third file.
        session.act({"do": "undo"})
        assert not read_project(session.project_file).choices.for_texture
        assert sorted(path.name for path in tmp_path.glob("*.json")) == [
            "ball_studio-2.json",
            "ball_studio.json",
        ]

    def test_a_removed_project_is_written_again(self, session):
        session.project_file.unlink()
        add_cone(session, 7)
        assert [cone.vertex for cone in read_project(session.project_file).choices.cones] == [7]


CONES = (3, 60, 200, 410, 500)


def around(vertices, centre, radius):
    """Return the vertices within a distance of one of them."""
    return np.flatnonzero(np.linalg.norm(vertices - vertices[centre], axis=1) <= radius)


def walk(mesh, start, count):
    """Return a path of a number of different vertices along edges, from lower to higher numbers where possible."""
    neighbours = {}
    for a, b in file_edges(mesh).tolist():
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    path = [start]
    while len(path) < count:
        path.append(max(v for v in neighbours[path[-1]] if v not in path))
    return tuple(path)


def choices_of_all_kinds(mesh):
    """Return choices with cones, one of them typed and one locked, paths, and paint in three layers."""
    chosen = Choices().placed(CONES).with_angle(60, 3.0).locked(200, True)
    chosen = chosen.cut(walk(mesh, 5, 9)).with_uncut(walk(mesh, 100, 4))
    for layer, centre, weight in (("no_cone", 30, None), ("no_seam", 300, None), ("importance", 600, 10)):
        chosen = chosen.painted(layer, Region.of_vertices(around(mesh.vertices, centre, 0.4)), weight)
    return chosen


def places_of(mesh, choices):
    return shape_of(mesh).places(choices.vertices())


class TestChangedMesh:
    """A mesh that was edited, and saved under its name."""

    @pytest.fixture
    def ball(self, mesh):
        return coneflat.read_mesh(mesh)

    def test_renumbered_vertices_are_found_again(self, tmp_path, ball):
        """All choices are those of the vertices at the same positions."""
        chosen, order = choices_of_all_kinds(ball), np.random.default_rng(1).permutation(len(ball.vertices))
        number = np.argsort(order)
        path = shapes.write_obj(tmp_path / "new.obj", ball.vertices[order], number[ball.triangles])
        carried = carried_over(chosen, places_of(ball, chosen), coneflat.read_mesh(path))
        assert carried.lost == ()
        expected = Choices().placed(number[list(CONES)].tolist())
        expected = expected.with_angle(int(number[60]), 3.0).locked(int(number[200]), True)
        assert carried.choices.cones == expected.cones
        for before, after in ((chosen.cuts, carried.choices.cuts), (chosen.uncut, carried.choices.uncut)):
            assert after == tuple(tuple(number[list(path)].tolist()) for path in before)
        # Painted regions may grow by less than an edge, so that they have no holes on finer meshes.
        for before, after in (
            (chosen.paint.no_cone, carried.choices.paint.no_cone),
            (chosen.paint.importance[0][1], carried.choices.paint.importance[0][1]),
        ):
            assert set(number[before.vertices()].tolist()) <= set(after.vertices())
            assert len(after.vertices()) < 1.5 * len(before.vertices())

    def test_choices_stay_in_place_on_a_finer_mesh(self, tmp_path, ball):
        chosen, fine = choices_of_all_kinds(ball), shapes.sphere(5)
        mesh = coneflat.read_mesh(shapes.write_obj(tmp_path / "new.obj", *fine))
        carried = carried_over(chosen, places_of(ball, chosen), mesh)
        assert carried.lost == ()
        reach = MAX_SHIFT * np.linalg.norm(np.ptp(mesh.vertices, axis=0))
        cones = [cone.vertex for cone in carried.choices.cones]
        distance = np.linalg.norm(mesh.vertices[cones][:, None] - ball.vertices[list(CONES)], axis=2)
        assert distance.min(axis=1).max() <= reach
        edges = {tuple(edge) for edge in file_edges(mesh).tolist()}
        for path in (*carried.choices.cuts, *carried.choices.uncut):
            assert {tuple(sorted(edge)) for edge in pairwise(path)} <= edges
        assert len(carried.choices.cuts[0]) > 2 * len(chosen.cuts[0])
        # The inside of the painted cap is painted, without holes, and nothing beyond it.
        spacing = np.linalg.norm(np.diff(ball.vertices[ball.triangles[:, :2]], axis=1), axis=2).max()
        painted = carried.choices.paint.no_cone.vertices()
        away = np.linalg.norm(mesh.vertices - ball.vertices[30], axis=1)
        assert set(np.flatnonzero(away < 0.4 - spacing)) <= set(painted)
        assert away[painted].max() <= 0.4 + COVERED * spacing

    def test_what_has_no_place_is_told_and_the_project_as_it_was_is_kept(self, tmp_path, mesh, ball):
        chosen, file = choices_of_all_kinds(ball), tmp_path / "ball_studio.json"
        Project(mesh, file_hash(mesh), chosen, places_of(ball, chosen)).save(file)
        before = file.read_bytes()
        is_left = (ball.vertices[:, 0] < 0.2)[ball.triangles].all(axis=1)
        shapes.write_obj(mesh, ball.vertices, ball.triangles[is_left])
        opened = open_project(mesh, project_path(mesh, tmp_path))
        (note,) = opened.notes
        gone = [cone for cone in CONES if ball.vertices[cone, 0] > 0.4]
        assert gone
        assert f"{len(chosen.cones) - len(opened.choices.cones)} cone" in note
        assert all(str(cone) in note for cone in gone)
        assert "ball_studio-2.json" in note
        assert (tmp_path / "ball_studio-2.json").read_bytes() == before
        assert opened.sha256 == file_hash(mesh)

    def test_a_moved_vertex_changes_no_choice(self, tmp_path, mesh, ball):
        """Their vertices stay the same, however far one of them was moved."""
        chosen, file = choices_of_all_kinds(ball), tmp_path / "ball_studio.json"
        Project(mesh, file_hash(mesh), chosen, places_of(ball, chosen)).save(file)
        moved = ball.vertices.copy()
        moved[CONES[0]] *= 3
        shapes.write_obj(mesh, moved, ball.triangles[::-1])
        for path in (mesh, file):
            opened = open_project(path, project_path(path, tmp_path))
            assert (opened.choices, opened.notes) == (chosen, ())

    def test_a_project_without_places_keeps_the_numbers(self, tmp_path, mesh, ball):
        chosen, file = choices_of_all_kinds(ball), tmp_path / "ball_studio.json"
        Project(mesh, file_hash(mesh), chosen).save(file)
        shapes.write_obj(mesh, 2 * ball.vertices, ball.triangles)
        opened = open_project(mesh, file)
        assert opened.choices == chosen
        assert "keep the numbers of their vertices" in opened.notes[0]

    def test_a_project_without_choices_of_vertices_is_opened_as_it_is(self, tmp_path, mesh):
        chosen = Choices().with_option("stretch", 0.5)
        Project(mesh, file_hash(mesh), chosen).save(tmp_path / "ball_studio.json")
        shapes.write_obj(mesh, *shapes.sphere(1))
        opened = open_project(mesh, project_path(mesh, tmp_path))
        assert (opened.choices, opened.notes, opened.sha256) == (chosen, (), file_hash(mesh))

    def test_corners_stay_on_the_boundary(self, tmp_path):
        hill = coneflat.read_mesh(shapes.write_obj(tmp_path / "hill.obj", *shapes.hill(16, 12)))
        diagonals = hill.vertices[:, :2] @ [[1, 1], [1, -1]]
        corners = [*diagonals.argmax(axis=0).tolist(), *diagonals.argmin(axis=0).tolist()]
        chosen = Choices()
        for corner in corners:
            chosen = chosen.with_corner(corner)
        fine = coneflat.read_mesh(shapes.write_obj(tmp_path / "fine.obj", *shapes.hill(31, 23)))
        carried = carried_over(chosen, places_of(hill, chosen), fine)
        ends, counts = np.unique(
            np.sort(fine.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1),
            axis=0,
            return_counts=True,
        )
        assert len(carried.choices.corners) == 4
        assert {*carried.choices.corners} <= set(ends[counts == 1].ravel().tolist())

    def test_places_are_read_back(self):
        points = 1e6 + np.random.default_rng(2).random((5, 3))
        plain = json.loads(json.dumps(Places("c", points).as_plain()))
        np.testing.assert_allclose(Places.from_plain(plain, 5).points, points, rtol=0, atol=1e-6)
        assert Places.from_plain(plain, 4) is None
        assert Places.from_plain({**plain, "offsets": "!"}, 5) is None
        assert Places.from_plain(None, 0) is None

    @pytest.mark.slow
    def test_a_session_stores_places_and_carries_choices_over(self, tmp_path, mesh):
        session = Session(tmp_path)
        try:
            session.open(mesh)
            add_cone(session, 7)
            assert session.wait_until_idle(120)
            assert read_project(session.project_file).places is not None
            vertices, faces = shapes.sphere(3)
            order = np.random.default_rng(3).permutation(len(vertices))
            shapes.write_obj(mesh, vertices[order], np.argsort(order)[faces])
            session.open(mesh)
            assert session.wait_until_idle(120)
            state = session.state()
            assert [cone["vertex"] for cone in state["choices"]["cones"]] == [int(np.argsort(order)[7])]
            assert "the choices are at the nearest vertices" in state["warnings"][0]
            # What is saved has the places on the changed mesh.
            shapes.write_obj(mesh, vertices, faces)
            session.open(mesh)
            assert [cone["vertex"] for cone in session.state()["choices"]["cones"]] == [7]
        finally:
            session.close()


def test_meshes_of_the_same_name_have_a_project_each(tmp_path):
    """Whose choices are not mixed, in whatever order they are opened."""
    (tmp_path / "other").mkdir()
    paths = [tmp_path / "ball.obj", tmp_path / "ball.off", tmp_path / "other" / "ball.obj"]
    for level, path in enumerate(paths, 1):
        vertices, faces = shapes.sphere(level)
        if path.suffix == ".obj":
            shapes.write_obj(path, vertices, faces)
        else:
            rows = [*(" ".join(map(str, row)) for row in vertices), *(f"3 {a} {b} {c}" for a, b, c in faces)]
            path.write_text("\n".join(["OFF", f"{len(vertices)} {len(faces)} 0", *rows]))
    expected = ["ball_studio.json", "ball_off_studio.json", "ball_obj_studio.json"]
    for _ in range(2):
        for number, (path, name) in enumerate(zip(paths, expected, strict=True)):
            file = project_path(path, tmp_path)
            assert file.name == name
            chosen = Choices().with_option("stretch", (1 + number) / 4)
            assert open_project(path, file).choices in (Choices(), chosen)
            Project(path, file_hash(path), chosen).save(file)
    # A mesh that was moved and edited keeps its project.
    paths[0].rename(tmp_path / "other" / "moved.obj")
    (tmp_path / "new").mkdir()
    shapes.write_obj(tmp_path / "new" / "ball.obj", *shapes.sphere(0))
    assert project_path(tmp_path / "new" / "ball.obj", tmp_path).name == "ball_studio.json"
