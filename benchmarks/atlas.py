"""Compare atlases with those of other packages: `python benchmarks/atlas.py` prints two Markdown tables.

The first table has a row for each model and package, the second one, that of the README, a row for each package. The
models are the ten of the gallery, as far as they are here (`common.MODELS`). The packages are coneflat with its
default cones, with more of them, and its maps for textures; boundary first flattening (BFF) as `comparisons`
implements it, not the program of its authors, with the default cones and one chart; xatlas and uvunwrap with their
defaults, where they are installed. All results are measured by `coneflat.measure` on the UV points that the packages
return; seam lengths are divided by the square root of the area.

With `--matched`, the results of coneflat have the area distortion of the others: by `stretch` with the fewest cones
that reach it, and by cones alone.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator

import numpy as np
from common import models, shapes, with_cones_for
from comparisons import flatten_by
from comparisons.atlases import installed_baselines, run_baseline

from coneflat import Flattening, check_mesh, flatten, unwrap
from coneflat.measures.distortion import Distortion
from coneflat.mesh.connectivity import TriangleMesh

# Area distortions to try in this order, and the number of bisections of the interval of the stretch.
ALLOWED = (0.2, 0.14, 0.1, 0.07, 0.05, 0.035, 0.025)
ROUNDS = 4
#: The models of `docs/gallery.md`.
GALLERY = "3holes,bunny,camelhead,elephant,face,fandisk,hand,horse,kitten,rocker-arm"
HEADINGS = "| package | flipped | with overlaps | QC distortion | area std | charts | seam length | covered | seconds |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--models", default=GALLERY, help='names with commas, or "" for all models and a bumpy sphere'
    )
    parser.add_argument(
        "--distortion", type=float, default=0.05, help="area distortion of the second flattening"
    )
    parser.add_argument("--largest", type=int, default=120_000, help="triangles")
    parser.add_argument(
        "--matched", action="store_true", help="ours at the area distortion of each other one"
    )
    arguments = parser.parse_args()
    print(
        "| model | triangles | method | charts | seam length | QC | area std | flipped | overlaps | packed | s |"
    )
    print("| --- " * 11 + "|")
    flatten(*shapes.sphere(2), charts="atlas")
    unwrap(*shapes.sphere(2))
    sums: dict[str, list[tuple[float, ...]]] = {}
    for name, mesh in chosen([word for word in arguments.models.split(",") if word], arguments.largest):
        for method, result, seconds in (
            matched(mesh) if arguments.matched else flattened(mesh, arguments.distortion)
        ):
            measures, packed = result.distortion, result.packing_efficiency
            flipped = measures.flipped + measures.degenerate
            sums.setdefault(method, []).append(
                (measures.charts, measures.seam_length, measures.qc_mean, measures.area_std, packed,
                 flipped, measures.overlap > 0, seconds)
            )  # fmt: skip
            print(row(name, mesh, method, measures, packed, seconds), flush=True)
    print(f"\n{HEADINGS}\n" + "| --- " * HEADINGS.count(" | ") + "| --- |")
    for method, values in sums.items():
        charts, length, qc, std, packed, *_ = np.mean(values, axis=0)
        flipped, overlapping, seconds = np.sum(values, axis=0)[5:]
        print(
            f"| {method} | {flipped:.0f} | {overlapping:.0f} of {len(values)} | {qc:.3f} | {std:.3f} | {charts:.1f} | "
            f"{length:.2f} | {packed:.2f} | {seconds:.1f} |"
        )


def chosen(names: list[str], largest: int) -> Iterator[tuple[str, TriangleMesh]]:
    for name, mesh in [("sphere", check_mesh(*shapes.sphere(5)).mesh), *models()]:
        if len(mesh.faces) <= largest and (not names or name in names):
            yield name, mesh


def row(
    name: str, mesh: TriangleMesh, method: str, measures: Distortion, packed: float, seconds: float
) -> str:
    flipped = measures.flipped + measures.degenerate
    return (
        f"| {name} | {len(mesh.faces):,} | {method} | {measures.charts} | {measures.seam_length:.2f} | "
        f"{measures.qc_mean:.4f} | {measures.area_std:.3f} | {flipped} | {measures.overlapping_pairs} | {packed:.2f} | "
        f"{seconds:.2f} |"
    )


def flattened(mesh: TriangleMesh, distortion: float) -> Iterator[tuple[str, Flattening, float]]:
    """Yield the result of each method on a mesh, and its seconds."""
    for method, options in (
        ("coneflat", {}),
        (f"coneflat, distortion {distortion:g}", {"distortion": distortion}),
    ):
        start = time.perf_counter()
        ours = flatten(mesh.vertices, mesh.faces, charts="atlas", **options)
        yield method, ours, time.perf_counter() - start
    start = time.perf_counter()
    texture = unwrap(mesh.vertices, mesh.faces)
    yield "coneflat unwrap", texture, time.perf_counter() - start
    start = time.perf_counter()
    boundary_first = flatten_by("bff", mesh.vertices, mesh.faces)
    yield "BFF (reimplemented here), on coneflat's cones and cut", boundary_first, time.perf_counter() - start
    for name in ("xatlas", "uvunwrap"):
        if name in installed_baselines():
            yield name, *run_baseline(name, ours)


def matched(mesh: TriangleMesh) -> Iterator[tuple[str, Flattening, float]]:
    """Yield the results of other packages on a mesh, and that of coneflat at the same area distortion."""
    default = flatten(mesh.vertices, mesh.faces, charts="atlas")
    for name in ("xatlas", "uvunwrap"):
        if name not in installed_baselines():
            continue
        theirs, seconds = run_baseline(name, default)
        yield name, theirs, seconds
        std = theirs.distortion.area_std
        start = time.perf_counter()
        ours = at_area_std(mesh, std)
        if ours is not None:
            label = f"coneflat as {name}, stretched, {len(ours.cones)} cones"
            yield label, ours, time.perf_counter() - start
        start = time.perf_counter()
        ours = with_cones_for(mesh.vertices, mesh.faces, std)
        yield f"coneflat as {name}, {len(ours.cones)} cones", ours, time.perf_counter() - start


def at_area_std(mesh: TriangleMesh, std: float) -> Flattening | None:
    """Return a flattening with bounded area distortion: the fewest cones, and the least stretch with them."""
    for allowed in ALLOWED:
        result = flatten(mesh.vertices, mesh.faces, distortion=allowed, stretch=1.0)
        if result.distortion.area_std > std:
            continue
        low, high = 0.0, 1.0
        for _ in range(ROUNDS):
            middle = (low + high) / 2
            attempt = flatten(mesh.vertices, mesh.faces, distortion=allowed, stretch=middle)
            if attempt.distortion.area_std <= std:
                result, high = attempt, middle
            else:
                low = middle
        return result
    return None


if __name__ == "__main__":
    main()
