"""What a user requires of the measures becomes an exit code."""

from __future__ import annotations

import csv
import math

import numpy as np
import pytest
import shapes
from click.testing import CliRunner

import coneflat
from coneflat import errors
from coneflat.apps.cli.main import cli
from coneflat.measures.requirements import REPORTED, Requirement, breaches, parse_requirements


@pytest.fixture
def folder(tmp_path, monkeypatch):
    shapes.write_obj(tmp_path / "ball.obj", *shapes.sphere(1))
    shapes.write_obj(tmp_path / "hill.obj", *shapes.hill(6, 5))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*words):
    return CliRunner().invoke(cli, words)


class TestForm:
    @pytest.mark.parametrize(
        ("text", "relation", "bound"),
        [("qc_mean=1", "=", 1), ("qc_mean==1", "=", 1), ("qc_mean<=1.05", "<=", 1.05), ("qc_mean >= 1e-3", ">=", 1e-3),
         ("qc_mean<2", "<", 2), (" qc_mean > -inf ", ">", -math.inf)],
    )  # fmt: skip
    def test_relations(self, text, relation, bound):
        assert parse_requirements([text], ["qc_mean"]) == (Requirement("qc_mean", relation, bound),)

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("flipped", "'flipped' is not a requirement; write flipped=0"),
            ("", "'' is not a requirement"),
            ("flipped=0,", "'' is not a requirement"),
            ("=3", "'=3' is not a requirement"),
            ("flipped=none", "'none' is not a number"),
            ("flipped=nan", "'nan' is not a number"),
            ("beauty=1", "unknown measure 'beauty': choose from .*area_std, .*flipped, .*overlap, "),
        ],
    )
    def test_invalid_requirements_are_refused(self, text, message):
        with pytest.raises(errors.OptionError, match=message):
            parse_requirements([text], REPORTED)

    def test_every_number_of_the_report_can_be_required(self):
        report = coneflat.flatten(*shapes.hill(6, 5)).report()
        numbers = {name for name, value in report.items() if isinstance(value, (int, float))}
        assert numbers <= set(REPORTED) <= set(report)


class TestMeeting:
    @pytest.mark.parametrize(
        ("text", "value", "met"),
        [("a=0", 0, True), ("a=0", 1, False), ("a<=1", 1.0, True), ("a<1", 1.0, False), ("a>=1", 1.0, True),
         ("a>1", 1.0, False), ("a<=1", None, False), ("a>=0", math.nan, False)],
    )  # fmt: skip
    def test_bounds(self, text, value, met):
        assert (breaches(parse_requirements([text], ["a"]), {"a": value}) == ()) == met

    def test_an_overlap_that_is_rounded_to_nothing_is_one(self):
        requirements = parse_requirements(["overlap=0"], REPORTED)
        assert breaches(requirements, {"overlap": 0.0, "overlapping_pairs": 0}) == ()
        assert len(breaches(requirements, {"overlap": 0.0, "overlapping_pairs": 2})) == 1


class TestFlatten:
    def test_an_unmet_requirement_gives_exit_code_3_and_the_file_is_written(self, folder):
        done = run("flatten", "hill.obj", "-q", "-o", "a.obj", "--require", "flipped=0,qc_mean<=1,charts>5")
        assert done.exit_code == 3
        lines = done.stderr.splitlines()
        assert [line.split(" is ")[0] for line in lines] == [
            "coneflat: requirement failed: qc_mean",
            "coneflat: requirement failed: charts",
            "coneflat: a.obj",
        ]
        assert (folder / "a.obj").exists()


def test_measure(folder):
    coneflat.flatten("ball.obj", charts="atlas").save("a.obj")
    assert run("measure", "a.obj", "--require", "flipped=0,overlap=0,corners_without_uv=0").exit_code == 0
    done = run("measure", "a.obj", "-q", "--require", "packing_efficiency>=1")
    assert done.exit_code == 3
    assert done.stderr.startswith("coneflat: requirement failed: packing_efficiency is 0.")
    assert done.stderr.count("\n") == 1


@pytest.mark.slow
def test_batch_counts_unmet_requirements_as_failures(folder):
    done = run("batch", "ball.obj", "hill.obj", "--out", "flat", "--jobs", "1", "--require", "triangles=60")
    assert done.exit_code == 1
    with open("flat/summary.csv", newline="") as file:
        rows = {row["mesh"][-8:]: row for row in csv.DictReader(file)}
    assert rows["hill.obj"]["status"] == "done"
    assert rows["ball.obj"]["status"] == "failed"
    assert "triangles is 80" in rows["ball.obj"]["error"]
    assert (folder / "flat" / "ball.obj").exists()
    assert np.isfinite(float(rows["ball.obj"]["qc_mean"]))
