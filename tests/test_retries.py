"""Policies: what fails is left out, and never loses what was found before."""

from __future__ import annotations

import pytest
import shapes

import coneflat
from coneflat import retries
from coneflat.errors import CurvatureError, MetricError


def test_a_later_search_that_fails_leaves_the_first_layout(monkeypatch):
    expected = coneflat.flatten(*shapes.sphere(2))
    lay_out, calls = retries.lay_out_component, []

    def fails_later(surface, component, steps):
        calls.append(len(component.faces))
        if len(calls) > 1:
            raise CurvatureError("no cones are left")
        return lay_out(surface, component, steps)

    monkeypatch.setattr(retries, "lay_out_component", fails_later)
    monkeypatch.setattr(retries, "infeasible_cones", lambda layout: layout.cones[:1])
    result = coneflat.flatten(*shapes.sphere(2))
    assert len(calls) > 1
    assert (result.cones == expected.cones).all()


def test_a_first_search_that_fails_is_an_error(monkeypatch):
    def fails(*_):
        raise CurvatureError("no cones are left")

    monkeypatch.setattr(retries, "lay_out_component", fails)
    with pytest.raises(CurvatureError, match="no cones are left"):
        coneflat.flatten(*shapes.sphere(2))


def test_required_cones_are_not_searched_again(monkeypatch):
    """A search cannot forbid them, so another one finds the same."""
    lay_out, calls = retries.lay_out_component, []
    monkeypatch.setattr(
        retries, "lay_out_component", lambda *inputs: calls.append(inputs) or lay_out(*inputs)
    )
    monkeypatch.setattr(retries, "infeasible_cones", lambda layout: layout.cones)
    coneflat.flatten(*shapes.sphere(2), required_cones=[0, 5, 7, 30], cone_count=4)
    assert len(calls) == 1


def test_a_component_that_fails_leaves_the_layouts_of_others():
    def flatten(members):
        if "bad" in members.values():
            raise CurvatureError("no metric")
        return {i: f"layout of {name}" for i, name in members.items()}

    components = {3: "first", 5: "bad", 8: "last"}
    layouts = retries.without_failures(flatten, components)
    assert layouts == {3: "layout of first", 8: "layout of last"}


@pytest.mark.parametrize("rounds", [1, 3])
def test_an_error_while_relaxing_names_its_component(rounds, monkeypatch):
    """Small components are relaxed together, so the one that fails is found by relaxing each alone."""
    relax = retries.relax_components

    def refuse(components, layouts, steps):
        if any(component.mesh.is_boundary_vertex.any() for component in components):
            raise MetricError("relaxation found no finite step")
        return relax(components, layouts, steps)

    monkeypatch.setattr(retries, "relax_components", refuse)
    ball, hill = shapes.sphere(rounds), shapes.hill()
    with pytest.raises(MetricError, match=f"in the component of vertex {len(ball[0])} .*no finite step"):
        coneflat.flatten(*shapes.join(ball, hill))
    with pytest.raises(MetricError, match="^relaxation found"):
        coneflat.flatten(*hill)
