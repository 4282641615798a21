"""Trial of integer grids and quads on random surfaces: `python benchmarks/grids.py --cases 200 --jobs 2`.

Surfaces of all topologies, deformed, renumbered and scaled by factors of a million up or down, some of them as
irregular as those of the hostile trial; from three squares to thousands; with all stretches, boundaries and cone
bounds.

Each case must end in a grid whose equations hold exactly and a manifold mesh of quads on the surface, checked
independently by `trials/grids.py`, or in an error of the package, in one line. Everything else, also a case that
takes too long, is a breach; the exit code is 1 if there is any. `--case 17` runs one case in this process and prints
all details.

`--kind few` makes quads of needles and of meshes of few triangles, from one quad to a thousand million: their
coordinates must be finite, and there may be at most 16 times as many as asked for.
"""

from __future__ import annotations

import sys
import time

from hostile import run_alone, summary, trial_parser
from trials.outcome import Outcome
from trials.workers import run_all

# CPU seconds that a case may take, by kind.
WORK = {"grid": 120.0, "few": 20.0}


def main() -> int:
    """Run the cases, print the summary, and return the exit code."""
    parser = trial_parser(__doc__, 200, "SEED")
    parser.add_argument("--kind", choices=tuple(WORK), default="grid")
    chosen = parser.parse_args()
    if chosen.case:
        return run_alone(f"{chosen.kind}:{chosen.case}")
    outcomes: list[Outcome] = []
    began = time.perf_counter()

    def say(outcome: Outcome, done: int) -> None:
        outcomes.append(outcome)
        for cause, details in outcome.breaches:
            print(f"breach {outcome.kind}:{outcome.seed}  {cause}: {details[:200]}", flush=True)
        if done % 50 == 0:
            print(f"{done:,} cases, {time.perf_counter() - began:.0f} s", flush=True)

    seeds = range(chosen.seed, chosen.seed + chosen.cases)
    run_all([(chosen.kind, seed) for seed in seeds], chosen.jobs, say, WORK[chosen.kind])
    print(f"\n{summary(outcomes)}\n\n{len(outcomes):,} cases in {time.perf_counter() - began:.0f} s")
    return int(any(result.breaches for result in outcomes))


if __name__ == "__main__":
    sys.exit(main())
