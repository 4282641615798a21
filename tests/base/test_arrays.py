"""Arrays that users pass: conversion at the door, and errors that name what is wrong."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

import coneflat
import coneflat.xatlas
from coneflat import errors
from coneflat.geometry import edge_lengths

V, F = shapes.hill(5, 4)
UV = V[F][:, :, :2]


class Lazy:
    """An array whose conversion takes no parameters, unlike NumPy passes them since version 2."""

    def __init__(self, array):
        self.array = np.asarray(array)

    def __array__(self):
        return self.array


class Surface:
    def __init__(self, **arrays):
        self.__dict__.update({name: Lazy(array) for name, array in arrays.items()})


@pytest.mark.parametrize(
    "call",
    [
        lambda wrap: coneflat.flatten(wrap(V), wrap(F)).uv,
        lambda wrap: coneflat.flatten((wrap(V), wrap(F))).uv,
        lambda wrap: coneflat.flatten(V, F, lengths=wrap(edge_lengths(V, F))).uv,
        lambda wrap: coneflat.flatten(V, F, seams=wrap([[7, 12], [12, 17]])).uv,
        lambda wrap: coneflat.flatten(V, F, weights=wrap(np.ones(len(V)))).uv,
        lambda wrap: coneflat.unwrap(wrap(V), wrap(F)).uv,
        lambda wrap: coneflat.Flattener(wrap(V), wrap(F)).flatten().uv,
        lambda wrap: coneflat.find_cones(wrap(V), wrap(F)).vertices,
        lambda wrap: coneflat.check_mesh(wrap(V), wrap(F)).mesh.vertices,
        lambda wrap: coneflat.measure(coneflat.check_mesh(V, F).mesh, wrap(UV)).qc,
        lambda wrap: coneflat.measure_uv(wrap(V), wrap(F), wrap(UV)).distortion.qc,
        lambda wrap: edge_lengths(wrap(V), wrap(F)),
        lambda wrap: coneflat.xatlas.parametrize(wrap(V), wrap(F))[2],
    ],
)
def test_objects_with_a_plain_conversion_are_arrays(call):
    np.testing.assert_array_equal(call(Lazy), call(np.asarray))


def test_meshes_of_such_objects_are_read():
    expected = coneflat.flatten(V, F).uv
    for mesh in (Surface(vertices=V, faces=F), Surface(points=V, faces=F)):
        np.testing.assert_array_equal(coneflat.flatten(mesh).uv, expected)


@pytest.mark.parametrize(
    ("faces", "message"),
    [
        (iter(F.tolist()), "faces must be an array of vertex indices"),
        ([[0, 1, 2], [0, 1]], "faces must be an array"),
        (F + 0.25, "faces must hold integers"),
        (np.where(F == 3, np.nan, F), "faces must hold integers"),
        (F.astype(object) + 10**300, "faces must be an array of vertex indices"),
    ],
)
def test_faces_that_are_not_indices_are_refused(faces, message):
    with pytest.raises(errors.ArrayShapeError, match=message):
        coneflat.flatten(V, faces)
