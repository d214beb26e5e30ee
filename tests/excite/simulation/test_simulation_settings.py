"""Settings of simulations: one number for all joints, or one for each."""

import numpy as np
import pytest

from excite.simulation.settings import SimulationSettings


@pytest.mark.parametrize("name", ["encoder", "position_noise", "velocity_noise", "torque_noise", "temperature"])
@pytest.mark.parametrize("given", [2, 2.0, [2.0], np.array([2.0]), np.float64(2.0)])
def test_one_number_stands_for_all_joints(name: str, given: object) -> None:
    assert getattr(SimulationSettings(**{name: given}), name) == (2.0,)
