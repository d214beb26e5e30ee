"""Public arms from their descriptions to identified parameters, as a user meets them: defaults wherever there are."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from public_arms import robots_folder

import excite
from regressors.readers.library import built_in_names
from regressors.robot.robot import Robot

HERE = Path(__file__).resolve().parent / "arms"


@dataclass(frozen=True)
class PublicArm:
    """One arm.

    Parameters
    ----------
    id : str
    file : str
        Below the folder of public descriptions, in ``tests/arms``, or a built-in name.
    base, tip : str, optional
        Ends of the chain.
    reason : str
        Words of the message where it goes no further than its design.
    condition : float
        Bound of cond(W) with normalised columns. First moments of the parallelogram's bars and of the links that they
        move beside are hardly told apart (m2c2y and m7c7y, m3c3x and m6c6x of irp6-full).
    smoothed : bool
        Light, stiff wrists with much friction: at this test's rate the simulation smooths Coulomb friction over 0.5
        rad/s, each drive otherwise, which is not the friction that is identified.
    """

    id: str
    file: str
    base: str | None = None
    tip: str | None = None
    reason: str = ""
    condition: float = 200.0
    smoothed: bool = False

    @property
    def robot(self) -> str | None:
        """Name or path of its description; None where the public descriptions are not installed."""
        if (HERE / self.file).is_file():
            return str(HERE / self.file)
        if "/" not in self.file:
            return self.file
        folder = robots_folder()
        return None if folder is None else str(folder / self.file)

    def __str__(self) -> str:
        return self.id


ARMS = (
    PublicArm("irp6", "irp6"),
    PublicArm("irp6 with its parallelogram", "irp6-full", reason="crank, coupler", condition=600.0),
    PublicArm("panda", "panda"),
    PublicArm("ur10e", "ur10e"),
    PublicArm("iiwa7", "iiwa7", reason="inertia"),
    PublicArm("so101", "so101"),
    PublicArm("panda with hand", "panda_description/urdf/panda.urdf"),
    PublicArm("ur3", "ur_description/urdf/ur3_robot.urdf"),
    PublicArm("ur5", "ur_description/urdf/ur5_robot.urdf"),
    PublicArm("ur10", "ur_description/urdf/ur10_robot.urdf"),
    PublicArm("ur5 with gripper", "ur_description/urdf/ur5_gripper.urdf"),
    PublicArm("kinova jaco", "kinova_description/robots/kinova.urdf"),
    PublicArm("unitree z1", "z1_description/urdf/z1.urdf"),
    PublicArm("so-100, desktop", "so_arm_description/urdf/so100.urdf"),
    PublicArm("so-101, desktop", "so_arm_description/urdf/so101.urdf"),
    PublicArm("talos, humanoid", "talos_data/robots/talos_left_arm.urdf"),
    PublicArm("tiago, mobile", "tiago_description/robots/tiago.urdf", "torso_lift_link", "arm_7_link", smoothed=True),
    PublicArm(
        "tiago with its lift", "tiago_description/robots/tiago.urdf", "base_footprint", "arm_7_link", smoothed=True
    ),
    PublicArm("tiago, dual arm", "tiago_description/robots/tiago_dual.urdf", "torso_lift_link", "arm_right_7_link"),
    PublicArm("tiago pro", "tiago_pro_description/robots/tiago_pro.urdf", "torso_lift_link", "arm_left_7_link"),
    PublicArm("baxter, dual arm", "baxter_description/urdf/baxter.urdf", "torso", "left_wrist"),
    PublicArm("pr2", "pr2_description/urdf/pr2.urdf", "torso_lift_link", "l_wrist_roll_link"),
    PublicArm("romeo, humanoid", "romeo_description/urdf/romeo.urdf", "torso", "l_wrist"),
    PublicArm("g1, humanoid", "g1_description/urdf/g1_29dof_rev_1_0.urdf", "torso_link", "left_wrist_yaw_link"),
    PublicArm("icub, humanoid", "icub_description/robots/icub.urdf", "chest", "l_hand"),
    PublicArm("finger", "finger_edu_description/robots/finger_edu.urdf"),
    PublicArm("z1 on b1, mobile", "b1_description/urdf/b1-z1.urdf", "link00", "link06"),
    PublicArm(
        "kinova on anymal, mobile",
        "anymal_b_simple_description/robots/anymal-kinova.urdf",
        "j2s6s200_link_base",
        "j2s6s200_link_6",
    ),
    PublicArm("centauro", "centauro_description/urdf/centauro.urdf", "torso_2", "arm1_6"),
    PublicArm("alex, humanoid", "alex_description/urdf/alex_nub_hands.urdf", "Torso", "LeftWristYawLink"),
    PublicArm("human", "human_description/robots/human.urdf", "middle_thorax", "left_hand", reason="virtual"),
    PublicArm("scara", "scara.urdf"),
    PublicArm("gantry with a wrist", "gantry.urdf"),
    PublicArm("arm of a mujoco model", "arm.xml"),
    PublicArm("arm of a table", "arm.csv"),
)

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
    limits = {} if name in built_in_names() else missing_limits(robot)
    task = excite.Task(name, **ends, starts=1, executor="serial", **limits)
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
    columns = {column.name: column for column in result.target.model.columns}
    judged = np.array([not (widened and columns[name].group == "friction") for name in result.names])
    error = np.abs(result.estimate.values - result.reference.values)[judged]
    inside = error <= result.estimate.half_width[judged]
    assert inside.mean() >= 0.93, [n for n, ok in zip(np.array(result.names)[judged], inside, strict=True) if not ok]
    assert np.all(error <= 2.0 * result.estimate.half_width[judged])
