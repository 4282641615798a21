"""Effect of each part of the cone search: `python benchmarks/ablation.py` prints a Markdown table.

The models of `../shared/meshes` and 20 deformed ones, E = 0.1, 0.2 and 0.3; for each variant, the total number of cones
and the CPU time of the search, without the factorization and the coarse model unless the variant concerns them.
--largest excludes large models; --variants selects variants whose names contain one of the given words.
"""

from __future__ import annotations

import argparse
import contextlib
import gc
import json
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from same import BASES, DEFORMATIONS, MODELS, deformed

from coneflat.base.progress import Stopwatch
from coneflat.base.threads import limit_threads
from coneflat.cones import coneless_solution, open_search
from coneflat.cones.sparse import aggregation, dense_model, exact_model, linear_model
from coneflat.cones.sparse import search as cone_search
from coneflat.io import as_input
from coneflat.options import Options
from coneflat.source import Source
from coneflat.stages import Surface

DISTORTIONS = (0.1, 0.2, 0.3)


def cases() -> Iterator[tuple[str, tuple[Any, ...]]]:
    """Yield names and meshes."""
    for path in sorted(MODELS.glob("*.*"), key=lambda path: path.stat().st_size):
        if path.suffix != ".md":
            yield path.name, (path,)
    for i, name in enumerate(BASES):
        for how in (DEFORMATIONS[i % 5], DEFORMATIONS[(i + 2) % 5]):
            yield f"{name} {how}", deformed(name, how)


Patch = tuple[Any, str, Any]


def variants() -> dict[str, list[Patch]]:
    """Return the changes of each variant."""
    search, dense, exact = cone_search, dense_model, exact_model
    found: dict[str, list[Patch]] = {"as it is": []}
    for module, name, values in (
        (search, "COARSE_MODEL_ERROR", (1.15, 1.2, 1.6)),
        (exact, "MAX_ROUNDS", (4, 100)),
        (exact, "MIN_PROMISED_GAIN", (1e-2, 1e-4)),
        (linear_model, "VERTICES_PER_UNKNOWN", (8, 15, 30)),
        (linear_model, "MIN_SIZE", (200, 400, 800)),
        (linear_model, "MAX_SIZE", (600, 2000)),
        (aggregation, "MAX_AGGREGATE", (4.0, 12.0)),
        (aggregation, "MAX_SIZE_RATIO", (1.0, 2.0)),
    ):
        found |= {f"{name} {value}": [(module, name, value)] for value in values}
    model = dense.DenseModel
    found["no descent"] = [(model, "descend", lambda *_: None)]
    found["no shrunk start"] = [(search.ConeSearch, "_refine", on_mesh_from_coarse)]
    found["both starts"] = [(search.ConeSearch, "_refine", on_mesh_both)]
    return found


def on_mesh_from_coarse(self: Any, count: int) -> float:
    if count in self.coarse.best:
        self.exact.refine(self.exact.insert(self.places[self.coarse.best[count].members]))
    return float(self.exact.best.energy(count))


def on_mesh_both(self: Any, count: int) -> float:
    exact, starts = self.exact, []
    if count in self.coarse.best:
        starts.append(exact.insert(self.places[self.coarse.best[count].members]))
    if count + 1 in exact.best:
        shrunk = exact.shrunk(exact.best[count + 1].members)
        starts += [] if shrunk is None else [shrunk]
    for start in starts:
        exact.refine(start)
    return float(exact.best.energy(count))


@contextlib.contextmanager
def patched(patches: list[Patch]) -> Iterator[None]:
    kept = [(owner, name, getattr(owner, name)) for owner, name, _ in patches]
    try:
        for owner, name, value in patches:
            setattr(owner, name, value)
        yield
    finally:
        for owner, name, value in kept:
            setattr(owner, name, value)


OPENING = ("VERTICES", "MIN_SIZE", "MAX_SIZE", "MIN_COUPLING", "MAX_AGGREGATE", "TRIES")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--largest", type=int, default=10**9, help="triangles")
    parser.add_argument("--smallest", type=int, default=0, help="triangles")
    parser.add_argument("--variants", default="", help="words, comma between")
    parser.add_argument("--skip", default="", help="words in the names of models to leave out, comma between")
    parser.add_argument("--out", type=Path, help="JSON of all counts")
    arguments = parser.parse_args()
    words = [word for word in arguments.variants.split(",") if word]
    skipped = [word for word in arguments.skip.split(",") if word]
    chosen = {
        n: v for n, v in variants().items() if n == "as it is" or not words or any(w in n for w in words)
    }
    totals: dict[str, list[float]] = {name: [0, 0.0, 0.0, 0] for name in chosen}
    counts: dict[str, dict[str, int]] = {name: {} for name in chosen}
    options = Options(repair=True)
    green, model = linear_model.GreenOperator, linear_model.coarse_model
    for case, given in cases():
        if any(word in case for word in skipped):
            continue
        with limit_threads():
            mesh, faces = given if len(given) == 2 else (given[0], None)
            part = max(Source(as_input(mesh, faces)).prepared(options).parts, key=lambda e: len(e.faces))
            if not arguments.smallest <= len(part.mesh.faces) <= arguments.largest:
                continue
            surface = Surface.of(part.mesh, part.lengths)
            if coneless_solution(surface, part.cones) is not None:
                continue
            operators: list[Any] = []
            coarse: list[Any] = []

            def one_operator(*given: Any) -> Any:
                if not operators:  # noqa: B023
                    operators.append(green(*given))  # noqa: B023
                return operators[0]  # noqa: B023

            def one_model(*given: Any) -> Any:
                if not coarse:  # noqa: B023
                    coarse.append(model(*given))  # noqa: B023
                return coarse[0]  # noqa: B023

            shared: list[Patch] = [
                (linear_model, "GreenOperator", one_operator),
                (linear_model, "coarse_model", one_model),
            ]
            with patched(shared):
                open_search(surface, part.cones, Stopwatch(None))
            for name, patches in chosen.items():
                changes_model = any(name.startswith(word) for word in OPENING)
                sharing = shared[:1] if changes_model else shared
                for distortion in DISTORTIONS:
                    surface.memo.clear()
                    gc.collect()
                    with patched(patches + sharing):
                        start = time.process_time()
                        search = open_search(surface, part.cones, Stopwatch(None))
                        opened = time.process_time()
                        found = search.fewest(distortion)
                    done = time.process_time()
                    totals[name][0] += len(found.solution.cones)
                    totals[name][1] += opened - start
                    totals[name][2] += done - opened
                    totals[name][3] += found.distortion > distortion
                    counts[name][f"{case} {distortion}"] = len(found.solution.cones)
        base = totals["as it is"]
        print(case, len(part.mesh.faces), base, file=sys.stderr, flush=True)
        if arguments.out:
            arguments.out.write_text(json.dumps({"counts": counts, "totals": totals}))
    print("| variant | cones | fewer, more | E missed | opening, s | search, s |")
    print("| --- | --- | --- | --- | --- | --- |")
    base_counts = counts["as it is"]
    for name, (cones, opening, seconds, missed) in totals.items():
        fewer = sum(counts[name][key] < base_counts[key] for key in base_counts)
        more = sum(counts[name][key] > base_counts[key] for key in base_counts)
        print(f"| {name} | {cones:.0f} | {fewer}, {more} | {missed} | {opening:.2f} | {seconds:.2f} |")


if __name__ == "__main__":
    main()
