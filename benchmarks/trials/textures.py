"""Cases of textures: `coneflat.unwrap` with random options, and the interface of xatlas on any triangles."""

from __future__ import annotations

import re
import warnings
from typing import Any

import numpy as np

from . import plane
from .choices import in_short, make_options
from .meshes import make_mesh, make_tiny
from .outcome import Outcome
from .promises import check
from .topology import Topology

Random = np.random.Generator

#: Notes after which energies may be larger; those of triangles that had to be opened are of other lengths.
EXCUSES = "The energy (of|is)|There (is|are) .*(flipped|degenerate)|Opened "


def texture_case(rng: Random, outcome: Outcome) -> None:
    """Unwrap a random mesh with random options; in one case of four as xatlas does."""
    texture_mesh(rng, outcome, *(make_mesh if rng.random() < 0.7 else make_tiny)(rng))


def texture_mesh(rng: Random, outcome: Outcome, vertices: np.ndarray, faces: np.ndarray, made: str) -> None:
    """Unwrap a mesh with random options; in one case of four as xatlas does."""
    if rng.random() < 0.25:
        check_xatlas(outcome, vertices, faces, made)
    else:
        unwrap_mesh(rng, outcome, vertices, faces, made)


def unwrap_mesh(
    rng: Random, outcome: Outcome, vertices: np.ndarray, faces: np.ndarray, made: str, **fixed: Any
) -> None:
    """Unwrap a mesh with random options, beside fixed ones."""
    import coneflat
    from coneflat.options import declarations
    from coneflat.textures import UnwrapOptions

    drawn = make_options(rng, vertices, faces)
    options = {name: value for name, value in drawn.items() if name in declarations(UnwrapOptions)} | fixed
    if rng.random() < 0.5:
        options["max_energy"] = float(rng.choice([4.001, 4.02, 4.05, 4.2, 4.5, 6.0, 40.0]))
    if rng.random() < 0.3:
        options["packing_cuts"] = float(rng.choice([0.0, 0.1, 0.5, 1.0]))
    if rng.random() < 0.05 and "resolution" not in options:
        options["texel_density"] = float(10 ** rng.uniform(-3, 3))
    outcome.recipe = f"unwrap {made}; {in_short(options)}"
    result = None
    expects_nan = not np.isfinite(vertices).all() or bool(re.search(r"\b(nan|inf)\b", in_short(options)))
    with outcome.guarded(expects_nan=expects_nan):
        result = coneflat.unwrap(vertices, faces, **options)
    if result is not None:
        check(outcome, result, {"charts": "atlas", **options, "method": "free seams"}, vertices, faces)
        check_energy(outcome, result, options.get("max_energy", 4.1))


def check_energy(outcome: Outcome, result: Any, bound: float) -> None:
    """Check that the energy of the components is at most the bound, and that the report has it."""
    if any(re.match(EXCUSES, note) for note in result.notes):
        outcome.excuse("energy above the bound")
        return
    at, flat = result.vertices[result.faces], result.uv[result.uv_faces]
    at = np.ldexp(at, -int(np.frexp(np.abs(at).max())[1]))
    component = Topology.of(result.faces, len(result.vertices)).component[result.faces[:, 0]]
    energy = np.zeros((component.max() + 1, 3))
    space, planar = (corners[:, 1:] - corners[:, :1] for corners in (at, flat))
    gram = space @ space.transpose(0, 2, 1)
    area = np.sqrt(np.maximum(np.linalg.det(gram), 0)) / 2
    # Orientation and energy of triangles almost without area are not known.
    has_area = area > 1e-9 * (gram[:, 0, 0] + gram[:, 1, 1])
    shape = np.linalg.solve(gram[has_area], planar[has_area] @ planar[has_area].transpose(0, 2, 1))
    stretch = np.trace(shape, axis1=1, axis2=2)
    ratio = np.linalg.det(shape)
    with np.errstate(divide="ignore"):
        rows = np.stack([area[has_area], area[has_area] * stretch, area[has_area] * stretch / ratio], axis=1)
    np.add.at(energy, component[has_area], rows)
    energy = energy[energy[:, 0] > 0]
    # At the best scale of each component.
    mean = 2 * np.sqrt(energy[:, 1] * energy[:, 2]) / energy[:, 0]
    if mean.max(initial=4.0) > bound + 2e-3 + 1e-3 * (bound - 4) and has_area.all():
        outcome.breach("energy above the bound", f"{mean.max():.5g}; notes {list(result.notes)}")


def check_xatlas(outcome: Outcome, vertices: np.ndarray, faces: np.ndarray, made: str) -> None:
    """Parametrize a mesh by `coneflat.xatlas`; wrong indices alone are refused."""
    import coneflat.xatlas
    from coneflat.geometry import find_overlaps

    outcome.recipe = f"xatlas {made}"
    mapped = None
    with np.errstate(over="ignore"):
        single = vertices.astype(np.float32)
    with outcome.guarded(expects_nan=True), warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        mapped = coneflat.xatlas.parametrize(single, faces)
    unmet = [record.message for record in caught if isinstance(record.message, coneflat.GuaranteeWarning)]
    notes = " ".join(note for warning in unmet for note in warning.notes)
    if len(unmet) > 1 or any(record.filename != __file__ for record in caught):
        outcome.breach("xatlas: warnings", [str(record) for record in caught])
    for record in caught:
        if record.category is not coneflat.GuaranteeWarning:
            outcome.breach(f"xatlas: warning {record.message}", record.filename)
    if mapped is None:
        if len(faces) and faces.min() >= 0 and faces.max() < len(vertices):
            outcome.breach("xatlas: refused", outcome.message)
        return
    mapping, indices, uvs = mapped
    if (mapping.dtype, indices.dtype, uvs.dtype) != (np.uint32, np.uint32, np.float32):
        outcome.breach("xatlas: types", (mapping.dtype, indices.dtype, uvs.dtype))
    if not np.array_equal(mapping[indices], faces):
        outcome.breach("xatlas: faces are not the input's")
    if not np.isfinite(uvs).all() or uvs.min(initial=0) < 0 or uvs.max(initial=1) > 1:
        outcome.breach("xatlas: outside the texture", uvs)
        return
    corners = uvs.astype(np.float64)[indices]
    area = plane.double_areas(corners)
    if (area < 0).any():
        _broken(outcome, "xatlas: flipped", notes, r"flipped", int((area < 0).sum()))
    pairs = find_overlaps(corners[area > 0]).pairs if (area > 0).any() else ()
    if len(pairs):
        _broken(outcome, "xatlas: overlaps", notes, r"overlap", len(pairs))


def _broken(outcome: Outcome, cause: str, notes: str, sentence: str, details: object) -> None:
    if re.search(sentence, notes):
        outcome.excuse(cause)
    else:
        outcome.breach(cause, f"{details}; warnings {notes}")
