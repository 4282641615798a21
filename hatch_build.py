"""Build hook: kernels compiled ahead, so that the first flattening after an installation does not wait for them.

numba keeps what it compiled beside the sources, stamped with their content and the processor; what fits neither is
compiled anew. A build for others' machines goes without: CONEFLAT_NO_KERNELS=1 hatch build.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

# What flattening arrays imports.
NEEDED = ("numpy", "scipy", "rslab", "numba", "threadpoolctl")
TIME_LIMIT = 300


class KernelHook(BuildHookInterface):
    """Adds the compiled kernels to a wheel, or leaves them beside the sources of an editable installation."""

    PLUGIN_NAME = "custom"

    def dependencies(self) -> list[str]:
        """Return what the build needs for this, at the versions that the package will run with."""
        if self._skipped():
            return []
        return [line for line in self.metadata.core.dependencies if line.startswith(NEEDED)]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile; a failure is reported and leaves the kernels to the first run."""
        if self._skipped():
            return
        sources = Path(self.root) / "src"
        if version != "editable":
            self._scratch = tempfile.TemporaryDirectory(
                prefix="coneflat-kernels-", ignore_cleanup_errors=True
            )
            copy = Path(self._scratch.name) / "src"
            shutil.copytree(sources, copy, ignore=shutil.ignore_patterns("__pycache__"))
            sources = copy
        self.app.display_info("compiling the kernels")
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(sources), *sys.path])}
        environment.pop("NUMBA_CACHE_DIR", None)
        try:
            subprocess.run(
                [sys.executable, "-m", "coneflat.apps.ahead"],
                env=environment,
                cwd=sources,
                check=True,
                timeout=TIME_LIMIT,
                capture_output=True,
            )
        except (OSError, subprocess.SubprocessError) as error:
            self.app.display_warning(f"kernels are compiled at the first run instead: {error}")
        if version != "editable":
            for file in sources.rglob("*.nb[ci]"):
                build_data["force_include"][str(file)] = str(file.relative_to(sources))

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove the scratch copy."""
        if hasattr(self, "_scratch"):
            self._scratch.cleanup()

    def _skipped(self) -> bool:
        return self.target_name != "wheel" or bool(os.environ.get("CONEFLAT_NO_KERNELS"))
