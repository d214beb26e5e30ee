"""Exported servos: what MuJoCo, URDF, Isaac Lab, YAML and BAM are told, and that the arm moves alike in MuJoCo."""

from __future__ import annotations

import json
import math
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
import yaml
from servo_arm import JOINTS, URDF, identified_servos, plant, servo_log, small_arm, true_servos, truth

import excite
from excite.export.exported import Exported
from excite.identification.servo_result import ServoResult
from excite.identification.servos import servo_motion
from excite.verification.verify_servos import verify_servos
from regressors.errors import InputError
from regressors.models.servo_response import STRIBECK_SPEED, SYMBOLS


def exported(result: ServoResult, form: str, folder: Path, **options: object) -> tuple[Exported, str]:
    written = excite.export_model(result, form, folder / f"out.{form}", replace=True, **options)
    return written, written.files[0].read_text(encoding="utf-8")


def in_mujoco(result: ServoResult, folder: Path) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(exported(result, "mjcf", folder)[1])


@pytest.mark.parametrize("servos", [true_servos, pytest.param(identified_servos, marks=pytest.mark.slow)])
def test_the_arm_moves_in_mujoco_along_an_unseen_log_as_it_is_verified(
    servos: Callable[[], ServoResult], tmp_path: Path
) -> None:
    result = servos()
    motion = servo_motion(servo_log(1, 12.0), result.robot)
    path = plant().replay(in_mujoco(result, tmp_path), motion.log, motion.samples.dq[0])
    error = np.sqrt(np.mean((path - motion.log.q) ** 2, axis=0))
    ours = [fit.position_error for fit in verify_servos(result, motion.log).fits]
    assert error.mean() < 1.1 * np.mean(ours), (error, ours)


def test_mujoco_is_told_what_the_servos_are(tmp_path: Path) -> None:
    model, told = in_mujoco(true_servos(), tmp_path), truth()
    np.testing.assert_allclose(model.dof_armature, told.J)
    np.testing.assert_allclose(model.dof_frictionloss, told.Fc)
    np.testing.assert_allclose(model.dof_damping, told.D)  # outside the limit of torque
    np.testing.assert_allclose(model.actuator_gainprm[:, 0], told.K)
    np.testing.assert_allclose(model.actuator_biasprm[:, :3], np.column_stack([told.K * told.b, -told.K, 0 * told.D]))
    np.testing.assert_allclose(model.actuator_forcerange, np.column_stack([-told.L, told.L]))
    np.testing.assert_allclose(model.actuator_delay, told.d + 0.0005)  # half a step
    assert (model.actuator_history[:, 0] * 0.0001 > told.d).all()  # enough where steps are made shorter
    free = in_mujoco(true_servos(L=1e5), tmp_path)
    assert not free.actuator_forcelimited.any()


def test_friction_holds_a_loaded_joint_that_rests(tmp_path: Path) -> None:
    model = in_mujoco(true_servos(K=0.1, D=0.0, Fc=2.0), tmp_path)  # gravity takes up to 1.35 Nm
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 5000)
    assert np.abs(data.qpos).max() < 1e-4


def test_constant_friction_has_a_part_of_all_that_resists(tmp_path: Path) -> None:
    Fc, K = truth().Fc, truth().K
    of = lambda **changed: in_mujoco(true_servos(**changed), tmp_path).dof_frictionloss - Fc  # noqa: E731
    np.testing.assert_allclose(of(delta=0.004), 0.004 * K)
    # the elbow holds 0.3 kg at 0.1 m and 0.02 kg at 0.22 m; angles of both joints are within 2 rad
    angles = np.add.outer(*2 * [np.linspace(-2.0, 2.0, 401)])
    load = 9.81 * (0.3 * 0.1 + 0.02 * 0.22) * np.sqrt(np.mean(np.cos(angles) ** 2))
    assert of(mu=0.5)[1] == pytest.approx(0.5 * load, rel=0.05)


def test_friction_near_standstill_depends_on_the_speed_and_has_no_control(tmp_path: Path) -> None:
    model = in_mujoco(true_servos(Fs=0.2), tmp_path)
    assert (model.nu, len(model.actuator_trnid)) == (3, 6)
    np.testing.assert_allclose(model.dof_frictionloss, truth().Fc)
    data = mujoco.MjData(model)
    for speed in (0.03, -0.1, 0.2):
        data.qpos[:], data.qvel[:] = 0.0, speed
        for _ in range(500):
            data.qvel[:] = speed
            mujoco.mj_step(model, data)
        wanted = -np.sign(speed) * 0.2 * np.exp(-((speed / STRIBECK_SPEED) ** 2))
        np.testing.assert_allclose(data.actuator_force[3:], wanted, atol=1e-3)
    urdf = exported(true_servos(Fs=0.2), "urdf", tmp_path)[1]
    assert f'friction="{0.12 + 0.15:.2g}"' in urdf


def test_what_the_logs_do_not_show_is_said_in_the_file_and_in_a_note(tmp_path: Path) -> None:
    half = np.zeros((3, len(SYMBOLS)))
    half[1, SYMBOLS.index("J")] = np.inf
    result = replace(true_servos(), half_width=half)
    for form in ("mjcf", "urdf", "drake", "isaac", "yaml", "bam"):
        written, text = exported(result, form, tmp_path)
        (note,) = (note for note in written.notes if note.startswith("the logs do not show these"))
        assert "elbow: J" in note
        assert "elbow: J" in text
        assert all(each in text for each in written.notes)
        assert "servos that were not saved" in text
    text = exported(result, "mjcf", tmp_path)[1]
    assert "J 0.008 +- inf kg m^2 ?" in text
    assert "J 0.01 +- 0 kg m^2, Fc" in text


OWN = """<mujoco>
  <compiler angle="radian"/>
  <default><position kp="7" ctrlrange="-1 1" forcerange="-9 9"/></default>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body name="upper">
      <inertial pos="0.1 0 0" mass="0.4" diaginertia="4e-4 4e-4 4e-4"/>
      <joint name="lift" axis="0 1 0" damping="3" limited="true" range="-2 2"/>
      <body name="lower" pos="0.2 0 0">
        <inertial pos="0.1 0 0" mass="0.3" diaginertia="3e-4 3e-4 3e-4"/>
        <joint name="elbow" axis="0 1 0" limited="true" range="-2 2"/>
        <body name="hand" pos="0.2 0 0">
          <inertial pos="0.02 0 0" mass="0.02" diaginertia="1e-6 1e-6 1e-6"/>
          <joint name="roll" axis="1 0 0" limited="true" range="-2 2"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="mine" joint="lift"></position>
    <!-- kept -->
  </actuator>
</mujoco>
"""


def test_a_copy_of_an_mjcf_has_the_servos_in_the_place_of_its_actuators(tmp_path: Path) -> None:
    (own := tmp_path / "own.xml").write_text(OWN, encoding="utf-8")
    text = exported(true_servos(L=1e5), "mjcf", tmp_path, robot_file=own)[1]
    assert "<!-- kept -->" in text
    assert '<geom type="plane" size="1 1 1"/>' in text
    model, fresh = mujoco.MjModel.from_xml_string(text), in_mujoco(true_servos(L=1e5), tmp_path)
    assert [model.actuator(k).name for k in range(model.nu)] == ["mine", "elbow", "roll"]
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    np.testing.assert_allclose(model.actuator_delay, truth().d + 0.001)
    for name in ("actuator_gainprm", "actuator_biasprm", "actuator_forcelimited", "actuator_gear"):
        np.testing.assert_array_equal(getattr(model, name), getattr(fresh, name), err_msg=name)
    for name in ("dof_armature", "dof_damping", "dof_frictionloss"):
        np.testing.assert_array_equal(getattr(model, name), getattr(fresh, name), err_msg=name)
    (once := tmp_path / "once.xml").write_text(exported(true_servos(Fs=0.1), "mjcf", tmp_path, robot_file=own)[1])
    again = mujoco.MjModel.from_xml_string(exported(true_servos(Fs=0.3), "mjcf", tmp_path, robot_file=once)[1])
    assert (again.nu, len(again.actuator_trnid)) == (3, 6)
    own.write_text(OWN.replace("<!-- kept -->", '<motor joint="lift"/>'), encoding="utf-8")
    with pytest.raises(InputError, match="'lift' has 2 actuators, 2 of them in the file itself; leave one"):
        exported(true_servos(), "mjcf", tmp_path, robot_file=own)


def test_a_copy_without_actuators_gets_them(tmp_path: Path) -> None:
    begin, end = OWN.index("  <actuator>"), OWN.index("</mujoco>")
    (own := tmp_path / "own.xml").write_text(OWN[:begin] + OWN[end:], encoding="utf-8")
    model = mujoco.MjModel.from_xml_string(exported(true_servos(), "mjcf", tmp_path, robot_file=own)[1])
    assert [model.actuator(k).name for k in range(model.nu)] == list(JOINTS)


@pytest.mark.parametrize("copied", [False, True])
def test_a_urdf_has_friction_damping_and_limits(copied: bool, tmp_path: Path) -> None:
    (own := tmp_path / "own.urdf").write_text(URDF, encoding="utf-8")
    text = exported(true_servos(), "urdf", tmp_path, **({"robot_file": own} if copied else {}))[1]
    joints = {joint.get("name"): joint for joint in ET.fromstring(text).iter("joint")}
    for name, D, Fc in zip(JOINTS, truth().D, truth().Fc, strict=True):
        dynamics, limit = joints[name].find("dynamics"), joints[name].find("limit")
        assert [float(dynamics.get(key, "nan")) for key in ("damping", "friction")] == [D, Fc]
        assert [float(limit.get(key, "nan")) for key in ("effort", "velocity")] == [8.0, 5.0]
    assert "K 15 +- 0 Nm/rad" in text


def test_isaac_labs_groups_have_delays_in_steps(tmp_path: Path) -> None:
    content = yaml.safe_load(exported(true_servos(Fs=0.1), "isaac", tmp_path)[1])
    (group,) = content["actuators"].values()
    (late,) = content["delayed_actuators"].values()
    assert (group["class_type"], late["class_type"]) == ("ImplicitActuatorCfg", "DelayedPDActuatorCfg")
    assert late["min_delay"] == late["max_delay"] == 4  # 22 ms
    for field, values in {"stiffness": truth().K, "viscous_friction": truth().D, "armature": truth().J}.items():
        assert group[field] == late[field] == dict(zip(JOINTS, values.tolist(), strict=True))
    assert set(group["effort_limit_sim"].values()) == set(late["effort_limit"].values()) == {8.0}
    assert group["friction"]["lift"] == pytest.approx(0.22)
    assert group["dynamic_friction"]["lift"] == pytest.approx(0.12)


def test_the_yaml_has_every_quantity_with_its_unit(tmp_path: Path) -> None:
    result = replace(true_servos(L=1e5), half_width=np.where(true_servos().values > 3.0, np.inf, 1e-5))
    content = yaml.safe_load(exported(result, "yaml", tmp_path)[1])
    assert content["stribeck_speed"] == STRIBECK_SPEED
    for joint, quantities in result.stated.items():
        for (name, stated), known in zip(quantities.items(), result.known[JOINTS.index(joint)], strict=True):
            assert content["servos"][joint][name] == {**stated, "known": bool(known)}


def bam_friction(parameters: dict[str, float], external: float, motor: float, dq: float) -> float:
    """Friction loss of BAM's model m5, as its paper and its ``compute_frictions`` have it."""
    p = parameters
    slow = math.exp(-(abs(dq / p["dtheta_stribeck"]) ** p["alpha"]))
    load = abs(p["load_friction_external"] * external - p["load_friction_motor"] * motor)
    near = abs(p["load_friction_external_stribeck"] * external - p["load_friction_motor_stribeck"] * motor)
    return p["friction_base"] + load + slow * (p["friction_stribeck"] + near)


def test_bams_friction_is_ours(tmp_path: Path) -> None:
    content = json.loads(exported(true_servos(Fs=0.2, mu=0.3), "bam", tmp_path)[1])
    for name, Fc in zip(JOINTS, truth().Fc, strict=True):
        own = content["servos"][name]
        for tau, motor, dq in np.random.default_rng(0).normal(0.0, (1.0, 1.0, 0.1), (20, 3)):
            ours = Fc + 0.3 * abs(tau) + 0.2 * math.exp(-((dq / STRIBECK_SPEED) ** 2))
            assert bam_friction(own, tau, motor, dq) == pytest.approx(ours)
        assert (own["model"], own["command_delay"], own["L"]) == ("m5", 0.022, 8.0)
        assert [own[key] for key in ("actuator", "kt", "R", "friction_viscous")] == [None] * 4


def test_what_a_format_does_not_hold_is_refused_in_words(tmp_path: Path) -> None:
    for form in ("npz", "csv", "md", "tex"):
        with pytest.raises(InputError, match="does not hold servos; choose mjcf, urdf"):
            exported(true_servos(), form, tmp_path)
    lift, *others = small_arm().joints
    slides = small_arm().replace(joints=(replace(lift, kind="prismatic"), *others))
    with pytest.raises(InputError, match="lift slides; choose mjcf"):
        exported(replace(true_servos(), robot=slides), "bam", tmp_path)


def test_a_saved_result_is_named_by_its_hash(tmp_path: Path) -> None:
    (file,) = true_servos().save(tmp_path / "servos")
    text = excite.export_model(tmp_path / "servos", "mjcf", tmp_path / "a.xml").files[0].read_text(encoding="utf-8")
    assert "servos.json with SHA-256 " in text
    assert excite.export_model(file, "yaml", tmp_path / "a.yaml").facts == {"servos": list(JOINTS)}
