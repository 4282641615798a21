"""Cases of surfaces with several layers: cloth with front and back, partly lined, triple, or given twice."""

from __future__ import annotations

import re

import numpy as np

from .choices import in_short, make_options
from .meshes import make_mesh, make_tiny
from .outcome import Outcome
from .promises import check
from .surfaces import Random
from .textures import check_xatlas, unwrap_mesh


def doubled_case(rng: Random, outcome: Outcome) -> None:
    """Flatten or unwrap a surface with several layers, or pass it through the interface of xatlas."""
    import coneflat

    sheet = (make_mesh if rng.random() < 0.7 else make_tiny)(rng)
    vertices, faces, layers, made = add_layers(rng, *sheet)
    outcome.recipe = made
    way = rng.random()
    if layers is not None and _is_whole(*sheet[:2]):
        single = coneflat.check_mesh(*sheet[:2]).mesh.components[0]
        count = coneflat.check_mesh(vertices, faces, repair=True).mesh.components[0]
        if count != layers * single:
            outcome.breach("doubled: layers are not those of the sheet", f"{count}, {layers} of {single}")
    if way < 0.3:
        check_xatlas(outcome, vertices, faces, made)
    elif way < 0.6:
        unwrap_mesh(rng, outcome, vertices, faces, made, repair=True)
    else:
        options = make_options(rng, vertices, faces) | {"repair": True}
        outcome.recipe += f"; {in_short(options)}"
        result = None
        has_nan = not np.isfinite(vertices).all() or bool(re.search(r"\b(nan|inf)\b", in_short(options)))
        with outcome.guarded(expects_nan=has_nan):
            result = coneflat.flatten(vertices, faces, **options)
        if result is not None:
            check(outcome, result, options, vertices, faces)


def add_layers(
    rng: Random, vertices: np.ndarray, faces: np.ndarray, made: str
) -> tuple[np.ndarray, np.ndarray, int | None, str]:
    """Return vertices and faces with further layers, their number if all are whole sheets, and a description.

    Layers have the vertices of the sheet, or their own at the same places.
    """
    points, layers, words, is_whole = vertices, [faces], list[str](), True
    for _ in range(int(rng.choice([1, 1, 1, 2, 3]))):
        layer, word = faces, "again"
        if rng.random() < 0.6:
            layer, word = faces[:, [0, 2, 1]], "back"
        if rng.random() < 0.3 and len(faces):
            # Around a random face, such as a lining.
            with np.errstate(all="ignore"):
                middle = vertices[np.clip(faces, 0, len(vertices) - 1)].mean(axis=1)
                distance = np.linalg.norm(middle - middle[rng.integers(len(faces))], axis=1)
            nearest = np.argsort(distance, kind="stable")[: int(rng.integers(1, len(faces) + 1))]
            layer, word = layer[nearest], f"part of {word}"
            is_whole = False
        if rng.random() < 0.25:
            layer, word = layer + len(points), f"{word} with its own vertices"
            points = np.concatenate([points, vertices])
            is_whole = False
        layers.append(layer)
        words.append(word)
    together = np.concatenate(layers)
    if rng.random() < 0.3:
        together = together[rng.permutation(len(together))]
        words.append("mixed")
    return points, together, len(layers) if is_whole else None, f"{made} + {', '.join(words)}"


def _is_whole(vertices: np.ndarray, faces: np.ndarray) -> bool:
    """Return whether a sheet is valid, and consistently oriented, and each face has a neighbour with another vertex."""
    import coneflat

    try:
        checked = coneflat.check_mesh(vertices, faces)
    except coneflat.ConeflatError:
        return False
    if checked.is_flipped.any():
        return False
    mesh = checked.mesh
    sizes = np.bincount(mesh.components[1][mesh.faces[:, 0]])
    return bool(sizes.min() > 1) and len(np.unique(np.sort(faces, axis=1), axis=0)) == len(faces)
