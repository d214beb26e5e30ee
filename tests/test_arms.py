"""Public arms from their descriptions to identified parameters, as a user meets them: defaults wherever there are."""

from __future__ import annotations

import numpy as np
import pytest
from arm_table import ARMS, PublicArm

import excite
from regressors.readers.library import built_in_names
from regressors.robot.robot import Robot

NOISE = 0.01  # of each joint's largest torque
TRACKING = 0.01  # of a joint's range


def missing_limits(robot: Robot) -> dict[str, object]:
    """What a user has to add: accelerations, and rates and ranges where the description has none that a motor has."""
    limits = robot.limits
    added: dict[str, object] = {}
    if not np.all(np.isfinite(limits.acceleration)):
        added["acceleration"] = (10.0,)
    if np.any(limits.velocity > 20.0):
        added["velocity"] = tuple(np.minimum(limits.velocity, 3.0).tolist())
    if not np.all(np.isfinite(limits.lower)):
        pairs = zip(np.maximum(limits.lower, -3.1), np.minimum(limits.upper, 3.1), strict=True)
        added["position"] = tuple((float(low), float(high)) for low, high in pairs)
    return added


def test_there_are_enough_of_them() -> None:
    assert len(ARMS) >= 25
    assert len({arm.id for arm in ARMS}) == len(ARMS)


@pytest.mark.slow
@pytest.mark.parametrize("arm", ARMS, ids=str)
def test_an_arm_goes_from_its_description_to_its_parameters(arm: PublicArm) -> None:
    if (name := arm.robot) is None:
        pytest.skip("example-robot-data is not installed (pip install example-robot-data)")
    robot = excite.load_robot(name, arm.base, arm.tip)
    ends = {"base_link": arm.base, "tip": arm.tip}
    task = excite.Task(
        name, **ends, starts=1, executor="serial", **({} if name in built_in_names() else missing_limits(robot))
    )
    design = excite.design_trajectory(task)
    assert design.feasible
    assert design.criteria["condition_number_column_normalised"] < arm.condition
    if arm.reason:
        assert "torque" in {each.limit for each in design.unchecked}
        with pytest.raises(excite.ExciteError, match=arm.reason):
            excite.simulate(design, rate=400.0)
        return
    torque = np.abs(excite.simulate(design, rate=400.0).log.effort).max(axis=0)
    simulation = excite.simulate(design, rate=400.0, noise=tuple((NOISE * torque).tolist()), seed=1)
    assert simulation.outcome.holds, simulation.outcome.failures
    assert all(joint.relative <= TRACKING for joint in simulation.outcome.tracking)
    result = excite.identify(name, simulation, design=design)
    if not arm.smoothed:
        assert_within_intervals(result, widened=any("widened" in note for note in simulation.notes))


def assert_within_intervals(result: excite.Identification, *, widened: bool) -> None:
    """All but a few parameters in their 99 % intervals; without friction where the simulation had to smooth it."""
    assert result.reference is not None
    columns = {column.name: column for column in result.target.model.columns}
    judged = np.array([not (widened and columns[name].group == "friction") for name in result.names])
    error = np.abs(result.estimate.values - result.reference.values)[judged]
    inside = error <= result.estimate.half_width[judged]
    assert inside.mean() >= 0.93, [n for n, ok in zip(np.array(result.names)[judged], inside, strict=True) if not ok]
    assert np.all(error <= 2.0 * result.estimate.half_width[judged])
