from __future__ import annotations

import os
import subprocess
import sys

import pytest
from browsing import browser, open_visit, viewed, viewed_page, visit  # noqa: F401
from stored_meshes import find_model

# As in an installation: otherwise each process compiles the bytecode again, which takes a second.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)


def pytest_configure(config):
    """Compile the kernels before a run of all tests; otherwise each worker would compile them."""
    is_worker = hasattr(config, "workerinput")
    if (
        config.args_source is pytest.Config.ArgsSource.TESTPATHS
        and not is_worker
        and not config.option.collectonly
    ):
        subprocess.run([sys.executable, "-m", "coneflat.apps.warm_up"], check=True)


def pytest_collection_modifyitems(items):
    """Mark the tests that open a page in a browser as slow."""
    for item in items:
        if "browser" in item.fixturenames:
            item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="session")
def shared(tmp_path_factory):
    """Return the path of a real model by its name; the test is skipped where it is absent."""
    folder = tmp_path_factory.mktemp("models")

    def path_of(name):
        try:
            return find_model(name, folder)
        except FileNotFoundError as error:
            pytest.skip(str(error))

    return path_of
