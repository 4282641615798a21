"""Small inputs that once failed, with what they give now: `python benchmarks/brought.py` prints a Markdown table.

The inputs are those of `../shared/cases`, beside the repository: what people brought (`brought`), and what a trial by
strangers found (`hostile`). Each runs as a command or as a script of the folder, in a process of its own, with a limit
of time. `--only NAME` runs the cases whose names contain NAME.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

CASES = Path(__file__).resolve().parents[2] / "shared" / "cases"
SOURCE = Path(__file__).resolve().parents[1] / "src" / "coneflat"
#: Seconds until a case is ended.
LIMIT = 300
#: Lines of a command that say what it gives.
TOLD = re.compile(
    r"^(error|note|warning|charts|cones|seam length|QC distortion|overlap|quads|irregular|angles)\b.*",
    re.MULTILINE,
)


class Commands:
    """The command lines of the cases, by name; written files go to a folder."""

    COMMAND = (sys.executable, "-m", "coneflat")

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def __iter__(self) -> Iterator[tuple[str, list[str]]]:
        """Yield the name of each case, and its command line."""
        yield from self._sheets()
        yield from self._plates()
        yield from self._files()
        yield from self._transfers()
        yield from self._hostile_quads()
        yield from self._further_cases()

    def _command(self, name: str, *options: object, ending: str = ".obj") -> list[str]:
        kind, *flags = map(str, options)
        return [*self.COMMAND, kind, str(CASES / name), "-o", str(self._folder / f"out{ending}"), *flags]

    def _script(self, name: str, *arguments: object) -> list[str]:
        return [sys.executable, str(CASES / name), *map(str, arguments)]

    def _sheets(self) -> Iterator[tuple[str, list[str]]]:
        for name in ("grid5", "sheet_hole", "plate3"):
            for kind in ("flatten", "unwrap"):
                yield f"{kind} {name}.obj", self._command(f"brought/{name}.obj", kind)
        for name in ("twosided.gltf", "twosided.obj"):
            file, ending = f"brought/{name}", ".glb" if name.endswith("gltf") else ".obj"
            copies = ("--stack", "copies")
            yield f"unwrap {name}", self._command(file, "unwrap", ending=ending)
            yield f"unwrap {name} --stack copies", self._command(file, "unwrap", *copies, ending=ending)

    def _plates(self) -> Iterator[tuple[str, list[str]]]:
        for name in ("plate_holes", "round_hole"):
            for further in ([], ["--sharp-angle", "40deg"]):
                text = " ".join(["quads", f"{name}.obj", "--quads 3000", *further])
                yield text, self._command(f"brought/{name}.obj", "quads", "--quads", 3000, *further)

    def _files(self) -> Iterator[tuple[str, list[str]]]:
        for name in ("brought/utm.obj", "hostile/far.obj"):
            yield f"unwrap {Path(name).name} -o o.glb", self._command(name, "unwrap", ending=".glb")
        cards, output = self._folder / "cards.obj", str(self._folder / "cards_uv.obj")
        with cards.open("w") as stream:
            subprocess.run(self._script("brought/cards.py", 10_000), stdout=stream, check=True)
        yield "flatten cards.py 10000", [*self.COMMAND, "flatten", str(cards), "-o", output]
        for name in ("attributes.ply", "attributes.gltf", "groups.obj"):
            for ending in (".obj", ".ply", ".glb", ".npz"):
                yield (
                    f"flatten {name} -o o{ending}",
                    self._command(f"brought/{name}", "flatten", ending=ending),
                )

    def _transfers(self) -> Iterator[tuple[str, list[str]]]:
        baked = str(self._folder / "baked.glb")
        for name in (
            "mirrored_repeat.gltf",
            "specgloss.gltf",
            "texture.ply",
            "two_textures.obj",
            "unlit.gltf",
        ):
            source, target = CASES / "brought" / name, self._folder / f"unwrapped-{Path(name).stem}.glb"
            subprocess.run([*self.COMMAND, "unwrap", str(source), "-o", str(target), "-q"], check=False)
            words = ["transfer", str(source), str(target), "-o", baked, "--resolution", "64"]
            yield f"transfer {name}", [*self.COMMAND, *words]

    def _hostile_quads(self) -> Iterator[tuple[str, list[str]]]:
        yield "quads_needle_nan.py 4 1.6e4", self._script("hostile/quads_needle_nan.py", 4, "1.6e4")
        needle = ("--quads", 10, "--sharp-angle", 0.7, "--stretch", 0, "--cones", "sparse")
        yield "quads q4.obj", self._command("hostile/q4.obj", "quads", *needle)
        yield "quads q52.obj --quads 1", self._command("hostile/q52.obj", "quads", "--quads", 1)
        dense = ("--quads", 1_000_000, "--stretch", 0)
        yield "quads q89.obj --quads 1000000", self._command("hostile/q89.obj", "quads", *dense)

    def _further_cases(self) -> Iterator[tuple[str, list[str]]]:
        yield "flatten two_corners.obj", self._command("brought/two_corners.obj", "flatten")
        yield "flatmap.py", self._script("brought/flatmap.py", Path(sys.executable).parent / "coneflat")
        yield "read_only.sh", ["bash", str(CASES / "hostile/read_only.sh"), sys.executable, str(SOURCE)]
        for name in ("xatlas_padding.py", "density_padding.py", "area_raw.py"):
            yield name, self._script(f"hostile/{name}")
        for label in ("short", "long"):
            options = ("brain", "--remove-label", f"{CASES}/hostile/{label}.annot:wall")
            yield f"brain b.gii, {label}.annot:wall", self._command("hostile/b.gii", *options, ending=".gii")


def run(command: list[str], folder: Path) -> tuple[float, int, str]:
    """Return the seconds that a command takes, its exit code, and what it says."""
    start = time.perf_counter()
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT, cwd=folder, check=False)
    except subprocess.TimeoutExpired:
        return time.perf_counter() - start, -1, f"ended after {LIMIT} s"
    return time.perf_counter() - start, done.returncode, done.stdout + done.stderr


def summary(text: str) -> str:
    """Return what a command says in a line."""
    told = [match.group(0) for match in TOLD.finditer(text)] or text.strip().splitlines()[-12:]
    return "; ".join(re.sub(r"\s+", " ", line) for line in told).replace("|", "/")[:700]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="text that the names of the cases contain")
    chosen = parser.parse_args().only
    if not CASES.exists():
        sys.exit(f"the cases are not in {CASES}")
    print("| case | exit code | s | gives |\n| --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for case, command in Commands(folder):
            if chosen in case:
                seconds, code, text = run(command, folder)
                print(f"| {case} | {code} | {seconds:.1f} | {summary(text)} |", flush=True)


if __name__ == "__main__":
    main()
