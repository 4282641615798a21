"""Components that are copies of each other: laid out once, as if each had been laid out by itself."""

from __future__ import annotations

from importlib import import_module

import numpy as np
import pytest
import shapes

import coneflat
from coneflat.base.arrays import FloatArray, IntArray
from coneflat.io import as_input
from coneflat.options import Options
from coneflat.source import Component, Source
from coneflat.source.copies import find_copies

flattener, retries = import_module("coneflat.flattener"), import_module("coneflat.retries")

Mesh = tuple[FloatArray, IntArray]


def joined(*meshes: Mesh) -> Mesh:
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    faces = [faces_of_mesh + start for (_, faces_of_mesh), start in zip(meshes, starts, strict=False)]
    return np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(faces)


def turned(mesh: Mesh, seed: int, scale: float = 1.0) -> Mesh:
    """Return a mesh turned about a random axis, scaled, and moved."""
    random = np.random.default_rng(seed)
    axes, _ = np.linalg.qr(random.normal(size=(3, 3)))
    axes[:, 0] *= np.linalg.det(axes)
    return scale * np.asarray(mesh[0]) @ axes.T + random.uniform(-20, 20, 3), mesh[1]


def bump() -> Mesh:
    vertices, faces = shapes.sphere(2, seed=3)
    return vertices * (1.0, 1.3, 0.8), faces


def parts_of(mesh: Mesh, options: Options) -> tuple[Component, ...]:
    return Source(as_input(*mesh)).prepared(options).components


def sides_of(result: coneflat.Flattening) -> FloatArray:
    """Return (m, 3) the lengths of sides in the plane, in units of length in space."""
    corners = result.uv[result.uv_faces]
    return np.linalg.norm(corners[:, [1, 2, 0]] - corners, axis=2) / result.uv_scale


def test_turned_scaled_copies_are_found_and_others_are_not() -> None:
    mesh = bump()
    mirrored = mesh[0] * (-1.0, 1.0, 1.0), mesh[1][:, ::-1]
    dented = mesh[0].copy(), mesh[1]
    dented[0][7] *= 1 + 1e-6
    model = joined(mesh, turned(mesh, 1), dented, turned(mesh, 2, 3.0), mirrored, turned(dented, 4))
    copies = find_copies(parts_of(model, Options()))
    assert [None if copy is None else copy.first for copy in copies] == [None, 0, None, 0, None, 2]
    assert [copy.scale for copy in copies if copy is not None] == pytest.approx([1.0, 3.0, 1.0], rel=1e-12)


@pytest.mark.parametrize(
    "options", [{"required_cones": (3,)}, {"weights": {3: 5.0}}, {"cones": {3: None, 9: None}}]
)
def test_components_with_options_for_vertices_are_not_copies(options: dict[str, object]) -> None:
    asked = coneflat.options.read_options(options)
    mesh = bump()
    assert find_copies(parts_of(joined(mesh, turned(mesh, 1)), asked)) == [None, None]


def test_creases_of_the_same_lengths_are_no_copies() -> None:
    """A sheet folded up and one folded half down have the same sides, and are not the same in space."""
    x, y = np.meshgrid(np.arange(5.0), np.arange(9.0))
    bend = np.abs(x - 2)
    number = np.arange(45).reshape(9, 5)
    a, b, c, d = (
        side.ravel() for side in (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1])
    )
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    up, zigzag = (np.stack([0.8 * x.ravel(), y.ravel(), 0.6 * z.ravel()], axis=1) for z in (bend, x % 2))
    sides = [np.sort(coneflat.geometry.edge_lengths(points, faces), axis=None) for points in (up, zigzag)]
    assert np.allclose(*sides, rtol=1e-12)
    assert find_copies(parts_of(joined((up, faces), (zigzag, faces)), Options())) == [None, None]


@pytest.mark.parametrize("mesh", [bump(), shapes.hill(9, 8)])
def test_copies_are_laid_out_as_each_by_itself(mesh: Mesh, monkeypatch: pytest.MonkeyPatch) -> None:
    model = joined(mesh, turned(mesh, 1), turned(mesh, 2, 2.5), turned(mesh, 3, 0.3))
    calls = []
    lay_out = retries.lay_out_with_thick_triangles
    monkeypatch.setattr(
        retries, "lay_out_with_thick_triangles", lambda *inputs: calls.append(inputs) or lay_out(*inputs)
    )
    result = coneflat.flatten(*model)
    assert len(calls) == 1
    monkeypatch.setattr(flattener, "find_copies", lambda components, _: [None] * len(components))
    alone = coneflat.flatten(*model)
    assert len(calls) == 1 + 4
    assert np.array_equal(result.cones, alone.cones)
    assert np.array_equal(result.seams, alone.seams)
    assert np.allclose(result.log_scale, alone.log_scale, rtol=0, atol=1e-7)
    assert np.allclose(sides_of(result), sides_of(alone), rtol=1e-7)
    assert result.distortion.flipped == 0


def test_the_search_is_linear_where_copies_are_rounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """Copies in single precision differ by more than double precision allows: each is a kind of its own."""
    module, calls = import_module("coneflat.source.copies"), []
    compare = module._scale_of_copy
    monkeypatch.setattr(
        module, "_scale_of_copy", lambda *arguments: calls.append(arguments) or compare(*arguments)
    )
    copies = [turned(bump(), seed) for seed in range(40)]
    vertices, faces = joined(*((np.asarray(v, dtype=np.float32).astype(float), f) for v, f in copies))
    assert find_copies(parts_of((vertices, faces), Options())) == [None] * 40
    assert len(calls) <= 40 * module.MAX_COMPARED
