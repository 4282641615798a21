"""The paper's numbers, on the two of its models that are at hand, and its experiments."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import shapes

from coneflat import PAPER, flatten

BENCHMARKS = Path(__file__).resolve().parents[1] / "benchmarks"
sys.path.insert(0, str(BENCHMARKS))

from paper import METHODS, MODELS, model_of, reproduce  # noqa: E402


def test_fandisk_as_in_tables_1_and_2(shared):
    d = flatten(shared("fandisk.obj"), **PAPER).distortion
    assert d.curvature_error == pytest.approx(4.6e-6, rel=0.05)
    assert d.qc_mean == pytest.approx(1.012, abs=0.001)


def test_rocker_arm_as_in_tables_1_and_2(shared):
    d = flatten(shared("rocker-arm.obj"), **PAPER).distortion
    assert 1.2e-5 <= d.curvature_error <= 1.4e-5
    assert d.qc_mean == pytest.approx(1.028, abs=0.001)


def test_models_are_known_by_their_names(tmp_path):
    assert model_of(tmp_path / "Rocker-Arm.OBJ") == "rockerarm"
    assert model_of(tmp_path / "isi_horse.ply") == "isi-horse"
    assert model_of(tmp_path / "cow.obj") is None
    assert MODELS["fandisk"].has_same_size(12_946)
    assert not MODELS["hand"].has_same_size(15_982)
    assert MODELS["torso"].qc == {"linear-abf/free": 1.004, "linear": 1.005}


@pytest.mark.slow
def test_the_experiments_of_the_paper(tmp_path):
    shapes.write_obj(tmp_path / "fandisk.obj", *shapes.sphere(3))
    shapes.write_obj(tmp_path / "another.obj", *shapes.hill(12, 12))
    (tmp_path / "gargoyle.obj").write_text("v 0 0 0\n")
    reproduction = reproduce([tmp_path])
    assert [model.name for model in reproduction.models] == ["fandisk", "another"]
    assert reproduction.failed[0][0] == "gargoyle.obj"
    assert "gargoyle" in reproduction.missing
    assert "fandisk" not in reproduction.missing
    first, second = reproduction.table_1()
    assert first[4] / first[5] == pytest.approx(first[6])
    assert np.isnan(second[5])
    rows = [row for row in reproduction.table_2() if row[0] == "fandisk"]
    assert len(rows) == len(METHODS)
    assert rows[0][1:4:2] == ["circle-patterns/fixed (CP)", 1.013]
    text = reproduction.markdown()
    assert "Not among the files: rockerarm, foot" in text
    assert "gargoyle.obj" in text
    assert "In another resolution" in text


@pytest.mark.slow
def test_the_script_writes_the_tables_and_figures(tmp_path):
    pytest.importorskip("matplotlib")
    mesh = shapes.write_obj(tmp_path / "ball.obj", *shapes.sphere(2))
    words = [sys.executable, BENCHMARKS / "paper.py", mesh, "-o", tmp_path / "paper"]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "Table 2" in done.stdout
    written = {path.name for path in (tmp_path / "paper").iterdir()}
    assert written == {"paper.md", "table1.csv", "table2.csv", *(f"figure{k}.png" for k in range(2, 6))}
