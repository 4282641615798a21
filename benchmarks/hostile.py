"""Fuzzing with hostile input: `python benchmarks/hostile.py --cases 10000 --jobs 2` runs 10,000 cases from seeds.

A case is a kind and a seed: `--case mesh:17` runs one case in this process and prints all details.

- mesh: small meshes of all kinds, many of them invalid, with random options;
- tiny: meshes of at most some twenty triangles, closed ones of two among them, with many options at once, and as quads;
- many: meshes of hundreds of such components, some repeated, some without area;
- texture: such meshes through `coneflat.unwrap`, with random options, and through the interface of xatlas;
- transfer: textured squares in every format, baked and measured, against a slow sampler;
- doubled: surfaces with several layers, on common vertices or their own, through all of these;
- file: mesh files of all formats, intact or damaged, read, flattened, written, and read back by other software;
- argument: public functions with odd arguments;
- command: odd command lines;
- process: commands with closed standard streams, and commands that a signal ends;
- attribute: files with groups, properties, colours, materials and so on, by `flatten`, `unwrap` and `quads`: all of it
  is in the written file, or a note names it;
- offset: files of models far from the origin: the triangles of the written file are those that were read, or a note.

Each runs in a worker with limits of time and memory. All guarantees of every result are measured again, by plain code
of this benchmark (`trials/promises.py`): finite points in the texture, no flipped triangle, no overlaps in an atlas,
angles around inner vertices and cones, equal sides of seams, prescribed boundaries, rotations by quanta, and a report
that says what was measured. What is not kept and not named by a note is a breach; so are errors that are not the
package's own, messages of several lines, crashes, hangs, and too much memory. The exit code is 1 if there is any.

Options: --cases 10000, --jobs 2, --seed 0 (the first), --kinds mesh,tiny,many,texture,doubled,transfer,file,
argument,command,process,attribute,offset, --out FILE.json (all outcomes), --again FILE.json (only the breaches of such
a file).
"""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
import tempfile
import time
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
for folder in ("src", "tests", "benchmarks"):
    sys.path.insert(0, str(ROOT / folder))

from trials.cases import KINDS, SHARES, cases, run_case  # noqa: E402
from trials.outcome import Outcome  # noqa: E402
from trials.workers import run_all  # noqa: E402

STATES = ("ok", "noted", "refused", "breach")


def summary(outcomes: list[Outcome]) -> str:
    """Return counts by kind, times and memory, and the breaches, most frequent first."""
    lines = [
        f"{'kind':10}{'cases':>8}"
        + "".join(f"{state:>9}" for state in STATES)
        + "   median    99%   worst   peak"
    ]
    for kind in (*KINDS, "all"):
        of_kind = [outcome for outcome in outcomes if kind in (outcome.kind, "all")]
        if not of_kind:
            continue
        count = Counter(outcome.status for outcome in of_kind)
        seconds = np.array([outcome.seconds for outcome in of_kind])
        times = f"{np.median(seconds):7.2f} s {np.quantile(seconds, 0.99):4.1f} s {seconds.max():5.1f} s"
        peak = max(outcome.memory for outcome in of_kind)
        row = "".join(f"{count[state]:9,}" for state in STATES)
        lines.append(f"{kind:10}{len(of_kind):8,}{row} {times} {peak:4.0f} MB")
    for title, groups in (
        ("breaches", _breaches(outcomes)),
        ("noted", _noted(outcomes)),
        ("refusals", _refusals(outcomes)),
    ):
        lines += ["", f"{title}:"] if groups else []
        ranked = sorted(groups.items(), key=lambda item: -len(item[1]))
        for cause, examples in ranked if title == "breaches" else ranked[:25]:
            first = ", ".join(f"{outcome.kind}:{outcome.seed}" for outcome, _ in examples[:4])
            lines.append(f"{len(examples):6,}  {cause}  [{first}]")
            if title == "breaches":
                lines.append(f"        {examples[0][0].recipe[:300]}: {examples[0][1][:300]}")
    return "\n".join(lines)


Groups = dict[str, list[tuple[Outcome, str]]]


def _breaches(outcomes: list[Outcome]) -> Groups:
    groups: Groups = defaultdict(list)
    for outcome in outcomes:
        for cause, details in outcome.breaches:
            groups[cause].append((outcome, details))
    return groups


def _noted(outcomes: list[Outcome]) -> Groups:
    groups: Groups = defaultdict(list)
    for outcome in outcomes:
        for promise in dict.fromkeys(outcome.noted):
            groups[promise].append((outcome, ""))
    return groups


def _refusals(outcomes: list[Outcome]) -> Groups:
    """Return the counts of errors by their message without numbers."""
    groups: Groups = defaultdict(list)
    for outcome in outcomes:
        if outcome.status == "refused":
            groups[re.sub(r"[-+]?\d[\d,.e+-]*", "#", outcome.message)[:140]].append((outcome, ""))
    return groups


def run_alone(case: str) -> int:
    """Run one case in this process, print its outcome, and return the exit code."""
    kind, _, seed = case.partition(":")
    os.environ["MPLBACKEND"] = "Agg"
    with tempfile.TemporaryDirectory() as home:
        before = Path.cwd()
        os.chdir(home)
        try:
            outcome = run_case(kind, int(seed))
        finally:
            os.chdir(before)
    print(f"{case}: {outcome.status} in {outcome.seconds:.2f} s, {outcome.memory:.0f} MB\n{outcome.recipe}")
    print(outcome.message or "no refusal")
    for promise in outcome.noted:
        print(f"noted: {promise}")
    for cause, details in outcome.breaches:
        print(f"breach: {cause}\n  {details}")
    return int(outcome.status == "breach")


def trial_parser(doc: str, cases: int, case: str) -> argparse.ArgumentParser:
    """Return the options of a trial; doc: its description, case: the name of a case."""
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument("--cases", type=int, default=cases)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--case", metavar=case)
    return parser


def main() -> int:
    """Run the cases, print the summary, and return the exit code."""
    parser = trial_parser(__doc__, 10_000, "KIND:SEED")
    parser.add_argument("--kinds", default=",".join(SHARES))
    parser.add_argument("--out", type=Path)
    parser.add_argument("--again", type=Path, help="only the breaches of a file that --out wrote")
    chosen = parser.parse_args()
    if chosen.case:
        return run_alone(chosen.case)
    outcomes: list[Outcome] = []
    began = time.perf_counter()

    def say(outcome: Outcome, done: int) -> None:
        outcomes.append(outcome)
        for cause, _ in outcome.breaches:
            print(f"breach {outcome.kind}:{outcome.seed}  {cause}", flush=True)
        if done % 500 == 0:
            print(f"{done:,} cases, {time.perf_counter() - began:.0f} s", flush=True)

    todo = cases(chosen.cases, chosen.seed, tuple(chosen.kinds.split(",")))
    if chosen.again:
        todo = [
            (record["kind"], record["seed"])
            for record in json.loads(chosen.again.read_text())
            if record["breaches"]
        ]
    try:
        run_all(todo, chosen.jobs, say)
    except KeyboardInterrupt:
        print("interrupted")
    text = summary(outcomes)
    print(f"\n{text}\n\n{len(outcomes):,} cases in {time.perf_counter() - began:.0f} s")
    if chosen.out:
        chosen.out.write_text(json.dumps([outcome.__dict__ for outcome in outcomes], indent=1))
    return int(any(outcome.breaches for outcome in outcomes))


if __name__ == "__main__":
    sys.exit(main())
