"""Dependencies resolved from wheels alone, for each platform and Python.

`python tools/wheels.py` prints a table of the number of packages that an installation has, without extras and with each
extra, and the version of numba. Where a package has no wheel, its name stands in the table; the exit code is then 1.
pip evaluates markers for the machine that it runs on; uv does for any other.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PLATFORMS = (
    "x86_64-manylinux_2_28", "aarch64-manylinux_2_28", "aarch64-apple-darwin", "x86_64-pc-windows-msvc"
)  # fmt: skip
PYTHONS = ("3.10", "3.14")
#: Extras that users install; those for developers may lack wheels somewhere.
EXTRAS = ("brains", "dask", "docs", "fast", "figures", "formats", "patterns", "studio")
DEVELOPERS_EXTRAS = ("bench", "blender-test", "dev")
TIME_LIMIT = 300  # seconds of one resolution
CONNECTIONS = 4  # resolutions at once, which mostly wait for the registry


@dataclass(frozen=True)
class Resolution:
    """The packages of one installation.

    Attributes:
        versions: version by name of package; empty if there is no solution.
        error: why there is none.
    """

    versions: dict[str, str]
    error: str = ""

    @property
    def cell(self) -> str:
        """The number of packages, or the name of the package without a wheel."""
        if not self.error:
            return str(len(self.versions))
        names = dict.fromkeys(re.findall(r"Wheels are required for `([^`]+)`", self.error))
        return f"no wheel: {' '.join(names)}" if names else "fails"


def find_uv() -> list[str]:
    """Return the command that runs uv; exit if it is not installed."""
    if find_spec("uv"):
        return [sys.executable, "-m", "uv"]
    if path := shutil.which("uv"):
        return [path]
    print("uv is not installed: python -m pip install uv", file=sys.stderr)
    raise SystemExit(2)


def resolve(uv: list[str], project: Path, platform: str, python: str, extra: str | None) -> Resolution:
    """Return the newest packages with wheels for a platform and a Python that fulfil a project's dependencies."""
    command = [*uv, "pip", "compile", str(project), "--only-binary", ":all:", "--prerelease", "disallow"]
    command += ["--python-platform", platform, "--python-version", python]
    command += ["--quiet", "--no-header", "--no-annotate", *(["--extra", extra] if extra else [])]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=TIME_LIMIT)
    if done.returncode:
        return Resolution({}, done.stderr.strip())
    pins = (line.split(";")[0].split("==") for line in done.stdout.splitlines() if "==" in line)
    return Resolution({name.strip(): version.strip() for name, version in pins})


def main() -> int:
    """Print the table; return the exit code."""
    parser = argparse.ArgumentParser(description="Resolve the dependencies from wheels alone.")
    parser.add_argument("--platforms", default=",".join(PLATFORMS), help="as uv names them")
    parser.add_argument("--pythons", default=",".join(PYTHONS), help="versions of Python")
    parser.add_argument("--extras", default=",".join(EXTRAS), help='extras; "" for none')
    parser.add_argument("--project", type=Path, default=ROOT / "pyproject.toml")
    arguments = parser.parse_args()
    uv = find_uv()
    extras = [None, *filter(None, arguments.extras.split(","))]
    print("| platform | Python | numba |", *(f"{extra or 'no extra'} |" for extra in extras))
    print("| --- " * (3 + len(extras)) + "|")
    errors = []
    with ThreadPoolExecutor(CONNECTIONS) as pool:
        for platform in arguments.platforms.split(","):
            for python in arguments.pythons.split(","):
                row = list(pool.map(partial(resolve, uv, arguments.project, platform, python), extras))
                numba = row[0].versions.get("numba", "-")
                print(f"| {platform} | {python} | {numba} |", *(f"{it.cell} |" for it in row), flush=True)
                errors += [f"{platform}, {python}: {it.error}" for it in row if it.error]
    print(*dict.fromkeys(errors), sep="\n", file=sys.stderr)
    return 1 if errors else 0


if __name__ == "__main__":
    raise SystemExit(main())
