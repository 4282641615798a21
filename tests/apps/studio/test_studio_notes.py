"""What the studio says of a result: measures of what would be saved, and all notes."""

from __future__ import annotations

import json
from io import BytesIO

import numpy as np
import pytest
import shapes
from test_studio_session import settled

import coneflat
from coneflat.apps.studio.outputs import as_shown, differing_measures, result_file
from coneflat.apps.studio.session import Session
from coneflat.apps.view import shown_rows
from coneflat.io import read_mesh


def saddle_of_quads(path, count=8):
    """Write bent quads, two of whose diagonals differ: other programs split them from their first corner.

    Of one quad that corner is moved close to the opposite side, so that this split has a needle.
    """
    u, v = np.meshgrid(np.arange(count + 1.0), np.arange(count + 1.0))
    vertices = np.column_stack([u.ravel(), v.ravel(), 0.2 * (u * v).ravel() / count])
    corner = np.arange(count * (count + 1)).reshape(count, count + 1)[:, :-1].ravel()
    quads = np.column_stack([corner, corner + 1, corner + count + 2, corner + count + 1])
    middle = quads[len(quads) // 2 + count // 2]
    vertices[middle[0]] = 0.51 * vertices[middle[1]] + 0.49 * vertices[middle[3]] + [-0.03, -0.03, 0.1]
    lines = [*(f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices)]
    lines += [f"f {' '.join(str(v + 1) for v in quad)}" for quad in np.roll(quads, 1, axis=1)]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def quads(tmp_path):
    return saddle_of_quads(tmp_path / "quads.obj")


def values_of(rows):
    return {name: value for name, value, *_ in rows}


def stretches(triangles, images):
    """Return (m,) ratios of the singular values of the maps of triangles (m, 3, 3) to (m, 3, 2), and their areas."""
    a, b = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    along = a / np.linalg.norm(a, axis=1, keepdims=True)
    height = b - (b * along).sum(axis=1, keepdims=True) * along
    flat = np.zeros((len(a), 2, 2))
    flat[:, 0, 0], flat[:, 0, 1] = np.linalg.norm(a, axis=1), (b * along).sum(axis=1)
    flat[:, 1, 1] = np.linalg.norm(height, axis=1)
    sides = np.stack([images[:, 1] - images[:, 0], images[:, 2] - images[:, 0]], axis=2)
    values = np.linalg.svd(sides @ np.linalg.inv(flat), compute_uv=False)
    return values[:, 0] / values[:, 1], flat[:, 0, 0] * flat[:, 1, 1] / 2


class TestMeasures:
    def test_the_measures_shown_are_those_of_the_triangles_in_the_file(self, quads, tmp_path):
        result = coneflat.flatten(quads)
        saved = result_file(result, ".obj")
        (tmp_path / "saved.obj").write_bytes(saved.content)
        file = read_mesh(tmp_path / "saved.obj")
        fans = [file.corners.reshape(-1, 4)[:, split] for split in ([0, 1, 2], [0, 2, 3])]
        points = [file.texture.reshape(-1, 4)[:, split] for split in ([0, 1, 2], [0, 2, 3])]
        qc, areas = stretches(file.vertices[np.concatenate(fans)], file.uv[np.concatenate(points)])
        shown = as_shown(result).distortion
        assert shown.qc_mean == pytest.approx(np.average(qc, weights=areas), rel=1e-6)
        assert shown.qc_max == pytest.approx(qc.max(), rel=1e-6)
        assert shown.qc_max > 1.2 * result.distortion.qc_max
        assert saved.notes == ()

    def test_a_file_with_other_measures_than_those_shown_says_so(self, quads):
        result = coneflat.flatten(quads)
        (note, *_) = result_file(result, ".glb").notes
        assert note.startswith("GLB: the measures of the file differ from those shown: ")
        shown, stored = values_of(shown_rows(as_shown(result))), values_of(shown_rows(result))
        assert f"QC distortion {stored['QC distortion']}, shown {shown['QC distortion']}" in note
        assert differing_measures(result, result) == ()

    def test_triangles_are_measured_as_they_are(self, mesh):
        result = coneflat.flatten(mesh)
        assert as_shown(result) is result
        assert result_file(result, ".ply").notes == ()

    @pytest.mark.slow
    def test_the_page_and_the_report_have_the_measures_of_the_obj(self, quads, tmp_path):
        session = Session(tmp_path)
        try:
            session.open(quads)
            settled(session)
            shown = as_shown(coneflat.flatten(quads))
            head, _ = session.picture()
            assert values_of(head["rows"]) == values_of(shown_rows(shown))
            assert f"QC mean {shown.distortion.qc_mean:.4f}" in head["title"]
            assert json.loads(session.export(".json"))["qc_max"] == shown.distortion.qc_max
            assert session.state()["warnings"] == list(shown.notes)
            version = session.version
            session.export(".glb")
            state = session.state()
            assert state["version"] > version
            assert any("GLB: the measures of the file differ" in warning for warning in state["warnings"])
            # They are those of that layout.
            session.act({"do": "set", "name": "stretch", "value": 0.5})
            assert not any("GLB" in warning for warning in settled(session)["warnings"])
        finally:
            session.close()


class TestNotes:
    @pytest.mark.slow
    def test_notes_of_the_result_and_of_the_saved_format_are_warnings(self, tmp_path):
        """The file has a vertex property that no OBJ keeps, and open edges that coincide with others."""
        vertices, faces = shapes.sphere(2)
        lone = np.concatenate([vertices, [[9.0, 9, 9]]])
        rows = [" ".join(f"{value:.9g}" for value in (*row, 0.5)) for row in lone]
        header = ["ply", "format ascii 1.0", f"element vertex {len(lone)}"]
        header += [f"property double {name}" for name in ("x", "y", "z", "quality")]
        header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
        path = tmp_path / "ball.ply"
        path.write_text("\n".join([*header, *rows, *(f"3 {a} {b} {c}" for a, b, c in faces)]) + "\n")
        result = coneflat.flatten(path)
        assert result.notes
        session = Session(tmp_path)
        try:
            session.open(path)
            settled(session)
            assert session.state()["warnings"] == list(result.notes)
            session.export(".obj")
            stored = coneflat.io.as_written(result, ".obj")
            lost = [f"OBJ: {note}" for note in stored.notes if note not in result.notes]
            assert lost
            assert "quality" in lost[0]
            assert session.state()["warnings"] == [*result.notes, *lost]
            assert np.load(BytesIO(session.export(".npz")))["uv"].shape == result.uv.shape
        finally:
            session.close()
