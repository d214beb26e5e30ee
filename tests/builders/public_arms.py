"""Chains and trees of public robots (example-robot-data) with Pinocchio's model of each, made without our reader."""

from __future__ import annotations

import sys
import xml.etree.ElementTree as ET
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

import numpy as np
import pytest

_INSIDE = "cmeel.prefix/share/example-robot-data/robots"
THETA_FROM_PINOCCHIO = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]  # its order is m, mc, Ixx, Ixy, Iyy, Ixz, Iyz, Izz
_PREFIX = "joint "


@dataclass(frozen=True)
class Arm:
    """An identifier, the file below the robots' folder, the first (None for the root) and the last link or links."""

    id: str
    file: str
    base: str | None
    tip: str | tuple[str, ...]

    @property
    def tips(self) -> tuple[str, ...]:
        """The last links, one of a chain."""
        return (self.tip,) if isinstance(self.tip, str) else self.tip

    @property
    def path(self) -> Path:
        """The file; the test is skipped where example-robot-data is not installed."""
        return robot_file(self.file)

    def __str__(self) -> str:
        return self.id


ARMS = tuple(
    Arm(*row)
    for row in (
        ("panda-hand", "panda_description/urdf/panda.urdf", None, "panda_hand"),
        ("panda-elbow", "panda_description/urdf/panda.urdf", "panda_link2", "panda_link5"),
        ("ur3", "ur_description/urdf/ur3_robot.urdf", None, "wrist_3_link"),
        ("ur5-gripper", "ur_description/urdf/ur5_gripper.urdf", "base_link", "tool0"),
        ("ur10", "ur_description/urdf/ur10_robot.urdf", "base_link", "ee_link"),
        ("kinova", "kinova_description/robots/kinova.urdf", None, "j2s6s200_link_6"),
        ("xarm7", "xarm_description/urdf/xarm7.urdf", None, "link7"),
        ("z1", "z1_description/urdf/z1.urdf", None, "gripperMover"),
        ("z1-held-gripper", "z1_description/urdf/z1.urdf", "link00", "link06"),
        ("so100", "so_arm_description/urdf/so100.urdf", None, "jaw"),
        ("so101", "so_arm_description/urdf/so101.urdf", None, "moving_jaw_so101_v1_link"),
        ("anymal-kinova", "anymal_b_simple_description/robots/anymal-kinova.urdf", None, "j2s6s200_link_6"),
        ("b1-z1", "b1_description/urdf/b1-z1.urdf", None, "gripperStator"),
        ("tiago-torso-arm", "tiago_description/robots/tiago.urdf", None, "arm_7_link"),
        ("tiago-head", "tiago_description/robots/tiago_no_hand.urdf", None, "head_2_link"),
        ("tiago-dual-left", "tiago_description/robots/tiago_dual.urdf", "torso_lift_link", "arm_left_7_link"),
        ("tiago-pro-right", "tiago_pro_description/robots/tiago_pro.urdf", "torso_lift_link", "arm_right_tool_link"),
        ("pr2-torso-right", "pr2_description/urdf/pr2.urdf", None, "r_wrist_roll_link"),
        ("pr2-laser", "pr2_description/urdf/pr2.urdf", "torso_lift_link", "laser_tilt_mount_link"),
        ("baxter-left", "baxter_description/urdf/baxter.urdf", "left_arm_mount", "left_hand_link"),
        ("talos-right-arm", "talos_data/robots/talos_full_v2.urdf", "torso_2_link", "arm_right_7_link"),
        ("talos-leg", "talos_data/robots/talos_reduced.urdf", None, "leg_left_6_link"),
        ("talos-left-arm-alone", "talos_data/robots/talos_left_arm.urdf", None, "arm_left_7_link"),
        ("centauro-arm", "centauro_description/urdf/centauro.urdf", "torso_2", "arm1_6"),
        ("icub-left-arm", "icub_description/robots/icub.urdf", "chest", "l_hand"),
        ("icub-leg", "icub_description/robots/icub.urdf", "root_link", "r_ankle_2"),
        ("romeo-right-arm", "romeo_description/urdf/romeo.urdf", None, "r_wrist"),
        ("alex-mimic-hand", "alex_description/urdf/alex_psyonic_hands.urdf", "Torso", "LeftGripperYawLink"),
        ("alexander-leg", "alexander_description/urdf/alexander_v1.lowerBodyOnly.urdf", None, "RIGHT_FOOT"),
        ("g1-left-arm", "g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf", None, "left_wrist_yaw_link"),
        (
            "g1-thumb",
            "g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf",
            "left_hand_palm_link",
            "left_hand_thumb_2_link",
        ),
        ("simple-humanoid-arm", "simple_humanoid_description/urdf/simple_humanoid.urdf", None, "l_wrist"),
        ("human-arm", "human_description/robots/human.urdf", "middle_thorax", "right_hand"),
        ("allegro-finger", "allegro_hand_description/urdf/allegro_left_hand.urdf", None, "link_3.0"),
        ("hextilt-arm", "hextilt_description/urdf/hextilt_flying_arm_5.urdf", None, "flying_arm_5__link_5"),
        ("double-pendulum", "double_pendulum_description/urdf/double_pendulum_continuous.urdf", None, "link2"),
        ("two-dofs", "asr_twodof_description/urdf/TwoDofs.urdf", None, "Link2"),
        ("finger-edu", "finger_edu_description/robots/finger_edu.urdf", None, "finger_lower_link"),
        ("solo12-leg", "solo_description/robots/solo12.urdf", None, "HR_LOWER_LEG"),
        ("anymal-c-leg", "anymal_c_simple_description/urdf/anymal.urdf", None, "LF_SHANK"),
        ("hyq-leg", "hyq_description/robots/hyq_no_sensors.urdf", None, "rh_lowerleg"),
        ("go2-leg", "go2_description/urdf/go2.urdf", None, "RR_calf"),
        ("quadruped-leg", "quadruped_description/urdf/quadruped.urdf", None, "BL_shank"),
    )
)


_CALVES = "FL_calf FR_calf RL_calf RR_calf"
_SHANKS = "LF_SHANK RF_SHANK LH_SHANK RH_SHANK"
_FEET = "FL_LOWER_LEG FR_LOWER_LEG HL_LOWER_LEG HR_LOWER_LEG"
_UPPER = "head_2_link arm_left_7_link arm_right_7_link"
_PR2_ARMS = "r_wrist_roll_link l_wrist_roll_link"
_G1 = "g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf"
_G1_FEET = "left_ankle_roll_link right_ankle_roll_link"
TREES = tuple(
    Arm(id, file, base, tuple(tips.split()))
    for id, file, base, tips in (
        ("go2", "go2_description/urdf/go2.urdf", None, _CALVES),
        ("baxter", "baxter_description/urdf/baxter.urdf", None, "head right_wrist left_wrist"),
        ("talos-upper", "talos_data/robots/talos_full_v2.urdf", None, _UPPER),
        (
            "allegro",
            "allegro_hand_description/urdf/allegro_left_hand.urdf",
            None,
            "link_11.0 link_7.0 link_3.0 link_15.0",
        ),
        ("tiago-dual", "tiago_description/robots/tiago_dual.urdf", None, _UPPER),
        ("icub", "icub_description/robots/icub.urdf", None, "l_ankle_2 r_ankle_2 l_hand head r_hand"),
        ("anymal", "anymal_c_simple_description/urdf/anymal.urdf", None, _SHANKS),
        (
            "hyq",
            "hyq_description/robots/hyq_no_sensors.urdf",
            None,
            "lf_lowerleg rf_lowerleg lh_lowerleg rh_lowerleg",
        ),
        ("solo12", "solo_description/robots/solo12.urdf", None, _FEET),
        ("solo", "solo_description/robots/solo.urdf", None, _FEET),
        ("b1-z1-legs-arm", "b1_description/urdf/b1-z1.urdf", None, f"{_CALVES} link06"),
        ("a1", "a1_description/urdf/a1.urdf", None, _CALVES),
        ("laikago", "laikago_description/urdf/laikago.urdf", None, _CALVES),
        ("pr2", "pr2_description/urdf/pr2.urdf", None, f"head_tilt_link laser_tilt_mount_link {_PR2_ARMS}"),
        ("pr2-arms", "pr2_description/urdf/pr2.urdf", "torso_lift_link", _PR2_ARMS),
        ("tiago-pro", "tiago_pro_description/robots/tiago_pro.urdf", None, _UPPER),
        ("centauro-arms", "centauro_description/urdf/centauro.urdf", None, "arm1_6 arm2_6"),
        ("romeo", "romeo_description/urdf/romeo.urdf", None, "l_ankle r_ankle HeadRollLink l_wrist r_wrist"),
        ("g1", _G1, None, f"{_G1_FEET} left_wrist_yaw_link right_wrist_yaw_link"),
        ("g1-hand", _G1, "left_hand_palm_link", "left_hand_thumb_2_link left_hand_index_1_link"),
        (
            "alex",
            "alex_description/urdf/alex_psyonic_hands.urdf",
            None,
            "Head LeftWristRollLink RightWristRollLink",
        ),
        (
            "human-upper",
            "human_description/robots/human.urdf",
            "middle_thorax",
            "middle_head left_hand right_hand",
        ),
        (
            "simple-humanoid",
            "simple_humanoid_description/urdf/simple_humanoid.urdf",
            None,
            "r_ankle l_ankle r_wrist l_wrist",
        ),
        (
            "anymal-kinova-tree",
            "anymal_b_simple_description/robots/anymal-kinova.urdf",
            None,
            f"{_SHANKS} j2s6s200_link_6",
        ),
    )
)
_FEW = ("go2", "baxter", "allegro", "tiago-dual")
SOME_TREES = tuple(pytest.param(tree, marks=() if tree.id in _FEW else pytest.mark.slow, id=tree.id) for tree in TREES)


def robots_folder() -> Path | None:
    """Folder of the example robots, None where they are not installed."""
    places = [Path(entry) / _INSIDE for entry in sys.path if entry]
    with suppress(PackageNotFoundError):
        places.insert(0, Path(str(distribution("example-robot-data").locate_file(_INSIDE))))
    return next((place for place in places if place.is_dir()), None)


def robot_file(name: str = "") -> Path:
    """A file or folder in that folder; the test is skipped where they are not installed."""
    folder = robots_folder()
    if folder is None:
        pytest.skip("example-robot-data is not installed (pip install example-robot-data)")
    return folder / name


@dataclass(frozen=True, eq=False)
class Reference:
    """Pinocchio's model of one chain or tree, all other joints locked at zero (mimic joints at their offset).

    ``joints`` are the moving ones' names from the base outwards; the model's joints 1, 2, ... are the same ones in that
    order (its own names carry a prefix, since Pinocchio cannot reduce a model where a joint and a link share a name).
    """

    model: Any
    joints: tuple[str, ...]
    base: str | None

    def joint(self, name: str) -> Any:
        """Pinocchio's joint model, with its indices ``id``, ``idx_q`` and ``idx_v``."""
        return self.model.joints[self.joints.index(name) + 1]

    def configuration(self, q: dict[str, float]) -> np.ndarray:
        """Pinocchio's configuration vector (cosine and sine for continuous joints) from joint positions by name."""
        vector = np.zeros(self.model.nq)
        for name in self.joints:
            joint = self.joint(name)
            values = [q[name]] if joint.nq == 1 else [np.cos(q[name]), np.sin(q[name])]
            vector[joint.idx_q : joint.idx_q + joint.nq] = values
        return vector

    def theta(self, joint: str) -> np.ndarray:
        """The ten parameters of the link that a joint moves, in our order."""
        inertia = self.model.inertias[self.joint(joint).id]
        return inertia.toDynamicParameters()[THETA_FROM_PINOCCHIO]

    def base_pose(self) -> np.ndarray:
        """Pose of the base link's frame in the root's, shape (4, 4); it does not move."""
        if self.base is None:
            return np.eye(4)
        frame = self.model.frames[self.model.getFrameId(self.base, _body())]
        assert frame.parentJoint == 0
        return frame.placement.homogeneous

    def link_poses(self, q: dict[str, float]) -> dict[str, np.ndarray]:
        """Pose of every link's frame relative to the base, shape (4, 4), by name."""
        import pinocchio as pin

        data = self.model.createData()
        pin.framesForwardKinematics(self.model, data, self.configuration(q))
        to_base = np.linalg.inv(self.base_pose())
        bodies = [(k, frame.name) for k, frame in enumerate(self.model.frames) if frame.type == _body()]
        return {name: to_base @ data.oMf[k].homogeneous for k, name in bodies}


def _body() -> Any:
    import pinocchio as pin

    return pin.FrameType.BODY


@cache
def _full_model(path: Path) -> tuple[Any, Any]:
    """The whole tree, and the configuration in which the joints off a chain are locked."""
    import pinocchio as pin

    robot = ET.parse(path).getroot()
    offsets = {}
    for joint in robot.findall("joint"):
        joint.set("name", _PREFIX + joint.get("name", ""))
        mimic = joint.find("mimic")
        if mimic is not None:
            offsets[joint.get("name")] = float(mimic.get("offset", 0))
            joint.remove(mimic)
    model = pin.buildModelFromXML(ET.tostring(robot, encoding="unicode"))
    q = pin.neutral(model)
    for name, joint in zip(model.names, model.joints, strict=True):
        if joint.nq == 1:
            q[joint.idx_q] = offsets.get(name, 0.0)
    return model, q


@cache
def reference(arm: Arm) -> Reference:
    """Pinocchio's reduced model of a chain or tree; the test is skipped where Pinocchio is not installed."""
    pin = pytest.importorskip("pinocchio", reason="Pinocchio is not installed (pip install pin)")
    full, q = _full_model(arm.path)
    tips = [full.frames[full.getFrameId(tip, _body())].parentJoint for tip in arm.tips]
    above = full.frames[full.getFrameId(arm.base, _body())].parentJoint if arm.base else 0
    moving = sorted({j for tip in tips for j in full.supports[tip]} - set(full.supports[above]))
    model = pin.buildReducedModel(full, [j for j in range(1, full.njoints) if j not in moving], q)
    names = [full.names[j] for j in moving]
    assert list(model.names)[1:] == names
    return Reference(model, tuple(name.removeprefix(_PREFIX) for name in names), arm.base)
