"""Without the package these tests skip and say so."""

import pytest

from . import package


@pytest.fixture(scope="session")
def deb():
    file = package.deb()
    if file is None:
        pytest.skip(f"the package isn't built: make deb-{package.here()}")
    return file


@pytest.fixture(scope="session")
def unpacked(deb, tmp_path_factory):
    return package.unpack(deb, tmp_path_factory.mktemp("deb") / "package")
