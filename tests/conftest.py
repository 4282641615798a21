from __future__ import annotations

import pytest
from browsing import browser, open_visit, viewed, viewed_page, visit  # noqa: F401
from stored import find_model


@pytest.fixture(scope="session")
def shared(tmp_path_factory):
    """Return the path of a real model by its name."""
    folder = tmp_path_factory.mktemp("models")
    return lambda name: find_model(name, folder)
