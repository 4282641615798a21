"""Small meshes of all kinds, most of them hostile, from a random generator."""

from __future__ import annotations

import numpy as np

from . import surfaces
from .changes import CHANGES
from .surfaces import MAKERS, Random


def make_mesh(rng: Random) -> tuple[np.ndarray, np.ndarray, str]:
    """Return vertices, faces and a description."""
    weights = np.array([weight for _, weight in MAKERS])
    maker = MAKERS[int(rng.choice(len(MAKERS), p=weights / weights.sum()))][0]
    vertices, faces = maker(rng)
    vertices, faces = np.array(vertices, dtype=np.float64), np.array(faces, dtype=np.int64)
    recipe = [maker.__name__]
    for change, chance in CHANGES:
        if rng.random() < chance and len(faces):
            vertices, faces = change(vertices, faces, rng)
            recipe.append(change.__name__)
    return vertices, faces, f"{' + '.join(recipe)}, {len(vertices)} vertices, {len(faces)} faces"


#: Meshes of a few triangles.
TINY = (
    surfaces.pillow,
    surfaces.pillow,
    surfaces.one_or_two,
    surfaces.fan,
    surfaces.crate,
    surfaces.ball,
    surfaces.ring,
    surfaces.tube,
    surfaces.cone,
)
#: Their most triangles.
TINY_FACES = 24


def make_tiny(rng: Random) -> tuple[np.ndarray, np.ndarray, str]:
    """Return vertices, faces and a description of a mesh of few triangles, one in three of them changed."""
    faces = np.zeros((0, 3), dtype=np.int64)
    while not 0 < len(faces) <= TINY_FACES:
        maker = TINY[int(rng.integers(len(TINY)))]
        vertices, faces = (np.array(one) for one in maker(rng))
    vertices, faces, recipe = vertices.astype(np.float64), faces.astype(np.int64), [maker.__name__]
    if rng.random() < 0.3:
        change = CHANGES[int(rng.integers(len(CHANGES)))][0]
        vertices, faces = change(vertices, faces, rng)
        recipe.append(change.__name__)
    return vertices, faces, f"{' + '.join(recipe)}, {len(vertices)} vertices, {len(faces)} faces"
