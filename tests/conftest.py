from __future__ import annotations

import pytest
from browsing import browser, open_visit, viewed, viewed_page, visit  # noqa: F401
from shapes import SHARED


@pytest.fixture
def shared():
    """Return the path of a real model; skip where there are none."""

    def find(name: str):
        path = SHARED / name
        if not path.exists():
            pytest.skip(f"the model {name} is not here")
        return path

    return find
