"""Values of options that are given as text, or in files of text."""

from __future__ import annotations

import numpy as np
import pytest

from coneflat import errors
from coneflat.options.texts import (
    parse_curvature,
    read_edges,
    read_vertex_map,
    read_vertices,
    read_vertices_or_pairs,
    read_word_or_vertex_map,
)


@pytest.mark.parametrize(
    ("text", "value"),
    [("1.5", 1.5), ("pi", np.pi), ("-pi/2", -np.pi / 2), ("0.5pi", np.pi / 2), ("3pi/2", 1.5 * np.pi),
     ("90deg", np.pi / 2), ("1e-1", 0.1), ("π", np.pi), ("-.25 pi", -np.pi / 4), ("2 * pi", 2 * np.pi)],
)  # fmt: skip
def test_forms_of_curvatures(text, value):
    assert parse_curvature(text, "here") == pytest.approx(value)


@pytest.mark.parametrize("text", ["", "x", "pi/0", "1..2", "pipi", "-", "deg", "nan", "1 2"])
def test_invalid_curvatures_are_refused(text):
    with pytest.raises(errors.OptionError, match="here"):
        parse_curvature(text, "here")


def test_vertices_in_words_and_in_files_are_the_same(tmp_path):
    (tmp_path / "v.txt").write_text("3 17  # two\n8\n17\n")
    assert read_vertices("--v", "3,17, 8") == read_vertices("--v", str(tmp_path / "v.txt")) == (3, 17, 8)
    with pytest.raises(errors.OptionError, match="--v: 'x' is not a vertex"):
        read_vertices("--v", "3,x")


def test_a_vertex_given_twice_is_refused():
    assert read_vertex_map("--cones", "cone", ["3,5:pi"]) == {3: None, 5: np.pi}
    with pytest.raises(errors.OptionError, match="vertex 3 is given as a cone twice"):
        read_vertex_map("--cones", "cone", ["3", "3:pi"])


def test_one_word_excludes_other_values():
    assert read_word_or_vertex_map("--cones", "cone", ["greedy"]) == "greedy"
    with pytest.raises(errors.OptionError, match="--cones takes one choice"):
        read_word_or_vertex_map("--cones", "cone", ["greedy", "3"])


def test_a_word_and_files_of_edges_are_combined(tmp_path):
    (tmp_path / "seams.txt").write_text("1 2\n3-4\n")
    file = str(tmp_path / "seams.txt")
    assert read_edges("--seams", ("input",), ["input"]) == "input"
    assert read_edges("--seams", ("input",), [file]).tolist() == [[1, 2], [3, 4]]
    word, pairs = read_edges("--seams", ("input",), ["input", file])
    assert word == "input"
    assert pairs.tolist() == [[1, 2], [3, 4]]
    with pytest.raises(errors.OptionError, match="vertices or pairs of them, not both"):
        read_vertices_or_pairs("--no-seams", ["3,4", file])
