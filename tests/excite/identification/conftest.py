"""Logs of the first three joints of the IRp-6 that tests of identification share."""

import pytest
from played import noisy, played, three_joints

from excite.logs.log import Log


@pytest.fixture(scope="session")
def log() -> Log:
    return played(three_joints(), 3)


@pytest.fixture(scope="session")
def noise() -> Log:
    return noisy(played(three_joints(), 3, seconds=4.005), 0.5, 1e-5, 1)
