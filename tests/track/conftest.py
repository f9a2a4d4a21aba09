"""A recorded call, made once."""

import time
from pathlib import Path

import pytest
from track.calls import end, leave


@pytest.fixture(scope="session")
def tracked(tmp_path_factory) -> Path:
    """Return a folder with one recorded call; only to be read."""
    folder = leave(tmp_path_factory.mktemp("tracked"))
    assert end(folder, "success", time.time() - 60) == (0, "", "")
    return folder
