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
        vertices, faces = (np.array(array) for array in maker(rng))
    vertices, faces, recipe = vertices.astype(np.float64), faces.astype(np.int64), [maker.__name__]
    if rng.random() < 0.3:
        change = CHANGES[int(rng.integers(len(CHANGES)))][0]
        vertices, faces = change(vertices, faces, rng)
        recipe.append(change.__name__)
    return vertices, faces, f"{' + '.join(recipe)}, {len(vertices)} vertices, {len(faces)} faces"


#: Powers of ten of the numbers of components of a mesh of many.
LOG_COUNTS = 2.0, 2.8
#: Their largest coordinates: others would leave only one component to see.
LARGEST_PLACE = 1e4


def make_many(rng: Random) -> tuple[np.ndarray, np.ndarray, str]:
    """Return vertices, faces and a description of a mesh of many tiny components, some repeated, some without area."""
    count = int(10 ** rng.uniform(*LOG_COUNTS))
    sizes, spacing = rng.choice([0.0, 1.0, 4.0]), float(rng.choice([0.0, 1.0, 3.0, 1e4]))
    pieces: list[tuple[np.ndarray, np.ndarray]] = []
    for number in range(count):
        if pieces and rng.random() < 0.1:
            vertices, faces = pieces[int(rng.integers(len(pieces)))]
            turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
            vertices = (
                vertices @ turn if rng.random() < 0.7 else vertices.astype(np.float32).astype(np.float64)
            )
        else:
            vertices, faces = _valid_piece(rng)
        if rng.random() < 0.03:
            vertices = vertices * [1.0, 0.0, 0.0]
        place = spacing * np.array([number % 40, number // 40, 0.0])
        pieces.append((10 ** (sizes * rng.normal() / 4) * vertices + place, faces))
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in pieces)])
    faces = np.concatenate([faces + start for (_, faces), start in zip(pieces, starts, strict=False)])
    return (
        np.concatenate([vertices for vertices, _ in pieces]),
        faces,
        f"{count} components, {len(faces)} faces",
    )


def _valid_piece(rng: Random) -> tuple[np.ndarray, np.ndarray]:
    """Return a tiny mesh whose indices and positions are valid: one that is not would refuse the whole mesh."""
    while True:
        vertices, faces, _ = make_tiny(rng)
        is_valid = len(faces) and faces.min() >= 0 and faces.max() < len(vertices)
        if is_valid and np.isfinite(vertices).all() and np.abs(vertices).max() < LARGEST_PLACE:
            return vertices, faces
