from __future__ import annotations

import subprocess
import sys

import pytest

import coneflat


def test_every_public_name_is_there():
    assert set(coneflat.__all__) == {*coneflat._HOMES, "errors", "__version__"}
    for name in coneflat.__all__:
        assert getattr(coneflat, name) is not None
    assert set(coneflat.__all__) <= set(dir(coneflat))
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = coneflat.nothing


def test_import_and_help_load_nothing_heavy():
    script = "import sys, coneflat, coneflat.cli.main; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    ).stdout.split()
    assert not {"numpy", "scipy", "trimesh", "matplotlib", "rich"} & set(loaded)


def test_errors_have_one_root():
    kinds = [kind for kind in vars(coneflat.errors).values() if isinstance(kind, type)]
    assert len(kinds) > 10
    assert all(issubclass(kind, coneflat.ConeflatError) for kind in kinds)
