"""Pictures of comparisons: layouts that lie alike, and text that fits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapes

import coneflat
from coneflat.apps.compare import run
from coneflat.apps.compare.pictures import Sight, draw_layouts, draw_qualities, turned_alike
from coneflat.apps.compare.run import Comparison, Entry, compare_methods

LONG = "circle-patterns/fixed"


@pytest.fixture(scope="module")
def hill():
    return coneflat.flatten(*shapes.hill(10, 8), cones="none")


def rotated(result, angle, factor=1.0, shift=0.0):
    turn = factor * np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return replace(result, uv=result.uv @ turn + shift)


@pytest.mark.parametrize("angle", [0.3, np.pi / 2, -2.9])
def test_layouts_are_turned_back_to_lie_as_the_first(hill, angle):
    others = [rotated(hill, angle), rotated(hill, angle, 0.4, 3.0)]
    entries = [Entry("a", hill, 1.0), *(Entry("b", each, 1.0) for each in others)]
    first, second, third = turned_alike(entries)
    assert first is hill
    sides = [np.diff(each.uv[each.uv_faces], axis=1) for each in (first, second, third)]
    np.testing.assert_allclose(sides[1], sides[0], atol=1e-12)
    np.testing.assert_allclose(sides[2], 0.4 * sides[0], atol=1e-12)


def test_layouts_of_other_charts_stay(hill):
    other = coneflat.flatten(*shapes.box(3), sharp_angle=1.0)
    assert turned_alike([Entry("a", hill, 1.0), Entry("b", other, 1.0)])[1] is other


@pytest.mark.parametrize("stretch", [1.0, 8.0])
def test_no_text_runs_into_another_or_over_the_edge(stretch):
    pytest.importorskip("matplotlib")
    vertices, faces = shapes.sphere(1)
    result = coneflat.flatten(vertices * [1, stretch, 1], faces)
    entries = tuple(Entry(LONG, result, 1.0) for _ in range(7))
    comparison = Comparison("x", len(faces), entries)
    for figure in (draw_layouts(comparison), draw_qualities(comparison, Sight())):
        width, height = figure.get_size_inches() * figure.dpi
        boxes = [text.get_window_extent() for text in figure.texts]
        labels = [text.get_window_extent() for text in figure.texts if text.get_text().startswith(LONG)]
        assert len(labels) == 7
        for box in boxes:
            assert box.x0 >= 0
            assert box.x1 <= width + 1
            assert 0 <= box.y0 <= box.y1 <= height + 1
        for k, one in enumerate(labels):
            for other in labels[k + 1 :]:
                assert not one.overlaps(other)
        assert min(text.get_fontsize() for text in figure.texts) > 5


def test_a_legend_is_as_wide_as_its_figure():
    pytest.importorskip("matplotlib")
    from coneflat.apps.compare.pictures import cone_panel, figure_of, in_rows

    vertices, faces = shapes.sphere(1)
    result = coneflat.flatten(vertices * [0.2, 3, 0.2], faces, cone_count=8)
    figure = figure_of(in_rows([cone_panel(result, Sight(), "x")]), marks_of=result)
    box = figure.legends[0].get_window_extent()
    assert box.x1 <= figure.get_size_inches()[0] * figure.dpi + 1


def test_of_what_is_quick_the_shorter_time_counts(monkeypatch):
    """The first time, code may have to be loaded."""
    calls = []
    real = run.flatten

    def slow_at_first(*arguments, **options):
        result = real(*arguments, **options)
        if len(result.faces) == 80 and options.get("method") == "lscm":
            calls.append(1)
            return replace(result, seconds={**result.seconds, "layout": 2.0 if len(calls) == 1 else 0.125})
        return result

    monkeypatch.setattr(run, "flatten", slow_at_first)
    found = compare_methods(*shapes.sphere(1), methods=("exact", "lscm"), peers=())
    metric = found["lscm"].result.seconds["metric"]
    assert len(calls) == 2
    assert found["lscm"].seconds == pytest.approx(0.125 + metric, abs=0.05)
