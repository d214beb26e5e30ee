"""How inertia is shared in a group, and which bodies stand for base parameters."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from identified import result_of, true_standard

import excite
from excite.export.models.exported_model import about_centre, model_of_result, number, quaternion_of, rpy_of
from excite.export.models.identified_model import IdentifiedModel, ModelDrive
from excite.export.models.nearest_bodies import NearestBodies, flat_bodies, flat_note, nearest_bodies, own_part
from excite.identification.prediction import instantaneous_target
from regressors.models.nominal import standard_values
from regressors.robot.gears import ConstantRatio
from regressors.robot.inertia import (
    from_centre_of_mass,
    from_pseudo_inertia,
    parameter_names,
    pseudo_inertia,
    rotation_from_rpy,
    transport,
)


def body(rng: np.random.Generator, size: float = 1.0) -> np.ndarray:
    x = np.column_stack([rng.normal(size=(6, 3)) * 0.1, np.ones(6)])
    return size * from_pseudo_inertia(x.T @ x)


@pytest.mark.parametrize("size", [1e-4, 0.3, 1.0, 30.0])
@pytest.mark.parametrize("seed", range(4))
def test_the_sum_of_a_group_is_kept_and_every_member_possible(seed: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    group, others = body(rng), []
    for _ in range(2):
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = rotation_from_rpy(rng.normal(size=3)), 0.1 * rng.normal(size=3)
        others.append((body(rng, size), T))
    own, factor = own_part(group, others)
    total = own + sum(factor * transport(T[:3, :3], T[:3, 3]) @ theta for theta, T in others)
    np.testing.assert_allclose(total, group, atol=1e-12)
    assert np.linalg.eigvalsh(pseudo_inertia(own))[0] > 0
    assert 0 < factor <= 1
    assert size > 1e-3 or factor == 1


def test_the_described_robot_is_its_own_nearest(tmp_path: Path) -> None:
    robot = excite.load_robot("ur10e")
    plain = result_of(robot, tmp_path, friction=False)
    target = instantaneous_target(robot, plain.task, plain.recipe)
    model = model_of_result(result_of(robot, tmp_path, standard_values(robot), friction=False))
    for link, described in zip(model.robot.links, robot.links, strict=True):
        scale = np.abs(described.theta).max()
        np.testing.assert_allclose(link.theta, described.theta, atol=1e-5 * scale)
    assert model.change < 1e-10
    assert target.base.names == plain.names


def test_bodies_that_change_torques_by_a_millionth_are_not_exact() -> None:
    assert [NearestBodies({}, change, {}).exact for change in (1e-12, 1e-6)] == [True, False]


def test_a_drive_that_turns_twice_as_far_as_its_joint_counts_by_that() -> None:
    """Torques reach the joint by the factor, and speeds the drive: friction once, damping and inertia squared."""
    drive = ModelDrive(1, "z", np.array([0.0, -2.0]), ConstantRatio(10.0), True, 1e-3, 0.7, 0.4)
    model: Any = SimpleNamespace(joint_drives=lambda joint: (drive,) if joint == drive.joint else ())
    found = [getattr(IdentifiedModel, what)(model, 1) for what in ("friction", "damping", "armature")]
    assert found == pytest.approx([2 * 0.7, 4 * 0.4, 4 * 100 * 1e-3])
    assert IdentifiedModel.damping(model, 0) is None


def test_zeros_and_equalities_of_the_structure_hold(tmp_path: Path) -> None:
    robot = excite.load_robot("irp6")
    model = model_of_result(result_of(robot, tmp_path))
    values = standard_values(model.robot)
    for name in model.robot.structure.zero:
        assert values.get(name, 0.0) == pytest.approx(0.0, abs=1e-12)


def test_parameters_of_the_estimator_at_a_bound_are_taken_as_they_are() -> None:
    """Bodies that no other bodies near them can stand for: those of a result of the estimator physical."""
    robot = excite.load_robot("ur10e")
    task = excite.Task("ur10e", joints=("1", "2"))
    target = instantaneous_target(robot, task, excite.Recipe(sign_width=0.0))
    values = true_standard(target)
    values |= {name: 0.0 for name in values if name.startswith("F")}  # friction at its bound
    for number_ in target.robot.body_numbers:
        thin = np.diag([1e-3, 1e-3, 2e-9, 1.0])
        values |= dict(zip(parameter_names(number_), from_pseudo_inertia(thin).tolist(), strict=True))
    definition, names = target.model.definition()
    beta = target.base.D @ definition @ np.array([values[name] for name in names])
    found = nearest_bodies(target, beta, None, values)
    assert found.change < 1e-9


def test_a_covariance_weighs_what_must_change(tmp_path: Path) -> None:
    """Where no bodies have the base parameters, the uncertain ones change."""
    robot = excite.load_robot("ur10e")
    result = result_of(robot, tmp_path, change={"I6zz": -5.0})
    target = instantaneous_target(robot, result.task, result.recipe)
    k = result.names.index("I6zz")
    for sure, changes in ((1e-6, False), (1e2, True)):
        covariance = np.diag(np.full(len(result.names), 1e-4))
        covariance[k, k] = sure**2
        found = nearest_bodies(target, result.coefficients, covariance, {})
        definition, names = target.model.definition()
        beta = target.base.D @ definition @ np.array([found.values[name] for name in names])
        others = np.delete(beta - result.coefficients, k)
        assert (np.abs(others).max() < 1e-4) == changes
        assert not found.exact


@given(st.lists(st.floats(-4, 4), min_size=3, max_size=3), st.booleans())
@settings(deadline=None, max_examples=50)
def test_rotations_read_back(rpy: list[float], locked: bool) -> None:
    R = rotation_from_rpy([rpy[0], np.pi / 2 if locked else rpy[1], rpy[2]])
    np.testing.assert_allclose(rotation_from_rpy(rpy_of(R)), R, atol=1e-15 * 8)
    w, x, y, z = quaternion_of(R)
    np.testing.assert_allclose(np.trace(R), 4 * w * w - 1, atol=1e-12)
    assert w * w + x * x + y * y + z * z == pytest.approx(1.0)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_read_back_to_the_same_bits(value: float) -> None:
    assert float(number(value)) == value


def test_inertia_about_the_centre_reads_back() -> None:
    theta = body(np.random.default_rng(0))
    np.testing.assert_allclose(from_centre_of_mass(*about_centre(theta)), theta, atol=1e-15)
    mass, centre, inertia = about_centre(np.zeros(10))
    assert mass == 0.0
    assert not np.any(centre)
    assert not np.any(inertia)


@pytest.mark.parametrize(
    ("size", "flat"),
    [((0.1, 0.2, 0.3), False), ((1.0, 1.0, 0.004), False), ((1.0, 1.0, 0.002), True), ((1.0, 0.001, 0.001), True)],
)
def test_flat_boxes_are_named(size: tuple[float, ...], flat: bool) -> None:
    a, b, c = size
    tensor = 5.0 / 12.0 * np.diag([b * b + c * c, a * a + c * c, a * a + b * b])
    body = from_centre_of_mass(5.0, np.array([0.3, -0.1, 0.7]), tensor)
    assert flat_bodies({"box": body}) == (("box",) if flat else ())
    assert ("box" in "".join(flat_note({"box": body, "cube": body}))) == flat
