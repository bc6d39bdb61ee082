"""What the tests of several models need."""

import pytest

from .controller import Rootcanal


@pytest.fixture
def rootcanal(short_folder):
    model = Rootcanal(short_folder / "rootcanal.log")
    yield model
    model.stop()
