"""Kernels are compiled once, whatever can be written to; a cached kernel is that of its code."""

from __future__ import annotations

import json
import logging
import os
import stat
import subprocess
import sys
import tempfile
import types
from importlib import import_module
from pathlib import Path

import numpy as np
import platformdirs
import pytest

import coneflat
from coneflat.base import kernel_cache
from coneflat.base.jit import compiled
from coneflat.base.kernel_cache import CACHE_VARIABLE, kernel_digest, read_kernel, write_kernel
from coneflat.errors import CacheError


def product(values, factor):
    """Return the sum of values times a factor."""
    total = 0.0
    for value in values:
        total += value * factor
    return total


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Return the cache folder of a test, beside which there is no other."""
    chosen = tmp_path / "cache"
    monkeypatch.setenv(CACHE_VARIABLE, str(chosen))
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(platformdirs, "user_cache_path", lambda *_, **__: tmp_path / "file" / "below")
    monkeypatch.setattr(tempfile, "gettempdir", lambda: str(tmp_path / "file"))
    kernel_cache.writable_folder.cache_clear()
    monkeypatch.setattr(kernel_cache, "compilation", kernel_cache.Compilation())
    yield chosen
    kernel_cache.writable_folder.cache_clear()


def copy_of(function):
    """Return another function of the same code, as a new process would have it."""
    return types.FunctionType(function.__code__, function.__globals__, function.__name__)


def test_a_kernel_is_compiled_once(folder):
    values = np.arange(4.0)
    assert compiled(copy_of(product))(values, 2.0) == 12.0
    assert kernel_cache.compilation.count == 1
    [file] = folder.iterdir()
    assert compiled(copy_of(product))(values, 3.0) == 18.0
    assert kernel_cache.compilation.count == 1
    assert list(folder.iterdir()) == [file]
    assert compiled(copy_of(product))(values.astype(np.float32), 1.0) == 6.0  # other types of arguments
    assert kernel_cache.compilation.count == 2


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="another name of the temporary folder")
def test_a_chosen_folder_gets_the_kernels_of_other_folders(folder, monkeypatch):
    compiled(copy_of(product))(np.arange(4.0), 2.0)
    monkeypatch.setattr(tempfile, "gettempdir", lambda: str(folder.parent))
    folder.rename(folder.parent / f"coneflat-{os.getuid()}")
    (folder.parent / f"coneflat-{os.getuid()}").chmod(0o700)
    kernel_cache.writable_folder.cache_clear()
    assert compiled(copy_of(product))(np.arange(4.0), 2.0) == 12.0
    assert kernel_cache.compilation.count == 1
    assert len(list(folder.iterdir())) == 1


@pytest.mark.parametrize(
    "damage",
    [lambda content: b"", lambda content: content[:-1], lambda content: content[:90] + b"x" + content[91:]],
)
def test_a_damaged_kernel_is_compiled_again(folder, damage, caplog):
    compiled(copy_of(product))(np.arange(4.0), 2.0)
    [file] = folder.iterdir()
    stored = file.read_bytes()
    file.write_bytes(damage(stored))
    caplog.clear()
    assert compiled(copy_of(product))(np.arange(4.0), 2.0) == 12.0
    assert [record.getMessage() for record in caplog.records] == [
        f"coneflat: {file} is damaged and is compiled again"
    ]
    assert read_kernel(file) is not None


def test_a_full_folder_is_one_line(folder, caplog, monkeypatch):
    def write(path, payload):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(kernel_cache, "write_kernel", write)
    kernel = compiled(copy_of(product))
    assert kernel(np.arange(4.0), 2.0) == 12.0
    assert kernel(np.arange(4), 2.0) == 12.0
    lines = [record.getMessage() for record in caplog.records if "No space" in record.getMessage()]
    assert len(lines) == 1
    assert CACHE_VARIABLE in lines[0]
    assert list(folder.iterdir()) == []


def test_without_a_folder_kernels_are_compiled_in_memory(tmp_path, folder, monkeypatch, caplog):
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "file" / "below"))
    kernel_cache.writable_folder.cache_clear()
    assert compiled(copy_of(product))(np.arange(4.0), 2.0) == 12.0
    [line] = [record.getMessage() for record in caplog.records]
    assert "in every process, as no cache folder is writable" in line
    assert CACHE_VARIABLE in line
    with pytest.raises(
        CacheError, match=r"no cache folder is writable \(tried: .*below\); set CONEFLAT_CACHE_DIR to one"
    ):
        kernel_cache.cache_folder()


def test_writing_leaves_no_incomplete_file(tmp_path, monkeypatch):
    def replace(source, target):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", replace)
    with pytest.raises(OSError, match="No space"):
        write_kernel(tmp_path / "a.kernel", b"content")
    assert list(tmp_path.iterdir()) == []


class TestDigest:
    """It changes with the code of a kernel, its constants and the kernels that it calls, and with nothing else."""

    @staticmethod
    def digest(source, **values):
        names = dict(values)
        exec(source, names)
        return kernel_digest(names["f"])

    def test_code_and_constants(self):
        documented = self.digest('def f(x):\n    """Other text."""\n    return x * a', a=2.0)
        assert documented == self.digest(
            '\n\ndef f(x: float):\n    """Text."""  # why\n    return x * a', a=2.0
        )
        digest = self.digest("def f(x):\n    return x * a", a=2.0)
        changed = [
            self.digest("def f(x):\n    return x * a", a=3.0),
            self.digest("def f(x):\n    return x + a", a=2.0),
            self.digest("def f(x):\n    return x * a * 2", a=2.0),
            self.digest("def f(x):\n    return x * b", b=2.0),
        ]
        assert len({digest, *changed}) == 5

    def test_called_kernels(self):
        def caller(source):
            names = {}
            exec(source, names)
            return self.digest("def f(x):\n    return g(x)", g=compiled(names["g"]))

        first = caller("def g(x):\n    return x + 1")
        assert first == caller("\ndef g(x):\n    return x + 1")
        assert first != caller("def g(x):\n    return x + 2")

    def test_objects_without_a_digest_are_refused(self):
        with pytest.raises(TypeError, match="has no digest"):
            self.digest("def f(x):\n    return x + a", a=object())

    def test_every_kernel_has_one(self):
        package = Path(coneflat.__file__).parent
        count = 0
        for path in sorted(package.rglob("*.py")):
            if "@compiled" not in path.read_text(encoding="utf-8"):
                continue
            module = import_module(".".join(["coneflat", *path.relative_to(package).with_suffix("").parts]))
            for value in vars(module).values():
                if isinstance(getattr(value, "_cache", None), kernel_cache.KernelCache):
                    kernel_digest(value.py_func)
                    count += 1
        assert count > 50


class TestFolders:
    """Where kernels are cached, in a process of its own with another environment."""

    SCRIPT = "import json; from coneflat.base.kernel_cache import writable_folder as w; print(json.dumps(str(w())))"

    def folder(self, tmp_path, **environment):
        inherited = {
            name: value
            for name, value in os.environ.items()
            if name not in (CACHE_VARIABLE, "XDG_CACHE_HOME")
        }
        done = subprocess.run(
            [sys.executable, "-c", self.SCRIPT],
            env={**inherited, "TMPDIR": str(tmp_path), **environment},
            capture_output=True,
            text=True,
            check=True,
        )
        return json.loads(done.stdout)

    def test_the_variable_comes_first(self, tmp_path):
        chosen = tmp_path / "chosen"
        assert self.folder(tmp_path, **{CACHE_VARIABLE: str(chosen)}) == str(chosen)

    def test_a_chosen_folder_that_is_not_writable_is_an_error_only_where_it_was_asked_for(self, tmp_path):
        (tmp_path / "file").write_text("")
        chosen = {CACHE_VARIABLE: str(tmp_path / "file" / "below")}
        assert self.folder(tmp_path, **chosen) != chosen[CACHE_VARIABLE]
        command = [sys.executable, "-m", "coneflat", "warm-up"]
        done = subprocess.run(
            command, env={**os.environ, **chosen}, capture_output=True, text=True, check=False
        )
        assert done.returncode == 2
        assert done.stderr.startswith("coneflat: error: no cache folder is writable (tried: ")
        assert len(done.stderr.splitlines()) == 1

    @pytest.mark.skipif(sys.platform != "linux", reason="other folders")
    def test_the_home_folder_is_used(self, tmp_path):
        home = tmp_path / "home"
        home.mkdir()
        assert self.folder(tmp_path, HOME=str(home)) == str(home / ".cache" / "coneflat")

    @pytest.mark.skipif(sys.platform != "linux", reason="other folders")
    def test_without_a_home_it_is_temporary_and_private(self, tmp_path):
        folder = Path(self.folder(tmp_path, HOME="/nonexistent"))
        assert folder == tmp_path / f"coneflat-{os.getuid()}"
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700
        assert not Path("/nonexistent").exists()

    @pytest.mark.skipif(sys.platform != "linux", reason="other folders")
    def test_without_any_home_and_any_temporary_folder_there_is_none(self, tmp_path):
        script = """
import os, pwd, tempfile
os.environ.pop("HOME", None)
def unknown(_): raise KeyError("no such user")
pwd.getpwuid = unknown
tempfile._candidate_tempdir_list = lambda: []
tempfile.tempdir = None
from coneflat.base.kernel_cache import readable_folders, writable_folder
print(writable_folder(), len(list(readable_folders())))
"""
        done = subprocess.run(
            [sys.executable, "-c", script],
            env={
                name: value
                for name, value in os.environ.items()
                if name not in ("XDG_CACHE_HOME", CACHE_VARIABLE)
            },
            capture_output=True,
            text=True,
            check=True,
        )
        assert done.stdout == "None 1\n"

    @pytest.mark.skipif(not hasattr(os, "getuid"), reason="no modes of files")
    def test_a_folder_that_others_can_write_to_is_not_used(self, tmp_path):
        home = tmp_path / "coneflat"
        home.mkdir()
        home.chmod(0o777)
        assert self.folder(tmp_path, XDG_CACHE_HOME=str(tmp_path)) != str(home)

    @pytest.mark.skipif(not hasattr(os, "getuid"), reason="no modes of files")
    def test_a_temporary_folder_of_somebody_else_is_not_used(self, tmp_path):
        target = tmp_path / "theirs"
        target.mkdir()
        (tmp_path / f"coneflat-{os.getuid()}").symlink_to(target)
        assert self.folder(tmp_path, HOME="/nonexistent") == "None"


def test_the_first_compilation_is_announced_and_reported(folder, caplog):
    """One line, and the count of kernels in the progress of the stage."""
    reported = []
    watch = coneflat.base.Stopwatch(lambda text, fraction: reported.append(text))
    with caplog.at_level(logging.WARNING), watch("stage"):
        kernel = compiled(copy_of(product))
        kernel(np.arange(4.0), 2.0)
        kernel(np.arange(4), 2.0)
    assert [record.getMessage() for record in caplog.records] == [
        f"coneflat: compiling, once, as the result is cached in {folder}: up to about "
        f"{kernel_cache.SECONDS_TO_COMPILE} s"
    ]
    assert reported == ["stage", "stage: compiling (1: product)", "stage: compiling (2: product)"]
