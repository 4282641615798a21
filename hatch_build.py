"""Build hook: on request, a wheel with compiled kernels for one platform, as for a container image.

A wheel is pure Python otherwise, and kernels are compiled at the first use. CONEFLAT_KERNELS=1 compiles them now, for
the processor and the Python of the build; the wheel gets the tag of that platform.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

#: Environment variable that requests compiled kernels.
REQUEST = "CONEFLAT_KERNELS"
#: Folder of the package for them, see `coneflat.base.kernel_cache`.
FOLDER = "coneflat/kernels"
TIME_LIMIT = 600


class KernelHook(BuildHookInterface):
    """Adds the compiled kernels to a wheel that requests them."""

    PLUGIN_NAME = "custom"

    def dependencies(self) -> list[str]:
        """Return what the package needs to run, at the versions that it will run with."""
        return self.metadata.core.dependencies if self._is_requested() else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile the kernels, and give the wheel the tag of the platform.

        Raises:
            RuntimeError: the kernels cannot be compiled.
        """
        if not self._is_requested() or version == "editable":
            return
        self._scratch = tempfile.TemporaryDirectory(prefix="coneflat-kernels-", ignore_cleanup_errors=True)
        # No kernel comes from another cache.
        empty = Path(self._scratch.name) / "empty"
        empty.mkdir()
        self.app.display_info("compiling the kernels")
        paths = [str(Path(self.root) / "src"), *sys.path]
        environment = {
            **os.environ,
            "PYTHONPATH": os.pathsep.join(paths),
            "PYTHONDONTWRITEBYTECODE": "1",
            "CONEFLAT_CACHE_DIR": self._scratch.name,
            **dict.fromkeys(("HOME", "XDG_CACHE_HOME", "LOCALAPPDATA", "TMPDIR", "TEMP", "TMP"), str(empty)),
        }
        command = [sys.executable, "-m", "coneflat.apps.warm_up"]
        try:
            done = subprocess.run(
                command, env=environment, check=False, timeout=TIME_LIMIT, capture_output=True, text=True
            )
        except subprocess.TimeoutExpired as error:
            raise RuntimeError(
                f"the kernels requested by {REQUEST} are not compiled in {TIME_LIMIT} s"
            ) from error
        kernels = sorted(Path(self._scratch.name).glob("*.kernel"))
        if done.returncode or not kernels:
            raise RuntimeError(
                f"the kernels requested by {REQUEST} cannot be compiled: {done.stderr[-2000:]}"
            )
        for file in kernels:
            build_data["force_include"][str(file)] = f"{FOLDER}/{file.name}"
        build_data["pure_python"] = False
        build_data["infer_tag"] = True

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove the scratch folder."""
        if hasattr(self, "_scratch"):
            self._scratch.cleanup()

    def _is_requested(self) -> bool:
        return self.target_name == "wheel" and os.environ.get(REQUEST, "0") not in ("", "0")
