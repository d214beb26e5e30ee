"""Information of earlier experiments, mapped to the base of a model and added."""

import dataclasses
import itertools

import numpy as np
import pytest
from designed import short

import excite
from excite.identification.result_json import earlier_information
from excite.information.earlier_precision import (
    deviations_of,
    earlier_estimate,
    earlier_root,
    geometry,
    noise_in_hand,
)
from excite.information.target import IdentificationTarget, target_of
from excite.information.weighting import weighting_of
from excite.registry import CONVENTIONS
from excite.tasks.robot_of_task import robot_and_task
from excite.tasks.stored_files import DESIGN, RESULT, EarlierInformation
from excite.tasks.task import Task

ROBOT, TASK = robot_and_task("irp6")
TARGET = target_of(ROBOT, TASK)


@pytest.fixture(scope="module")
def short_design() -> excite.Design:
    return short()


def _definition(target: IdentificationTarget) -> tuple[np.ndarray, tuple[str, ...]]:
    D, names = target.model.definition()
    return target.base.D @ D, names


def _result(rng: np.random.Generator, target: IdentificationTarget = TARGET) -> EarlierInformation:
    A, names = _definition(target)
    b = len(A)
    return EarlierInformation(
        name="r",
        kind=RESULT,
        sha256=f"{rng.integers(2**62):x}",
        robot="irp6",
        robot_sha256=ROBOT.sha256(),
        geometry=geometry(target.robot),
        payload=None,
        logs=(f"{rng.integers(2**62):x}",),
        parameters=names,
        A=A,
        factors=(rng.standard_normal((2 * b, b)),),
        equations=tuple(target.model.row_labels),
        density=tuple(rng.uniform(0.5, 2.0, len(target.model.row_labels))),
        seconds=4.0,
        degrees_of_freedom=100,
        values=rng.standard_normal(b),
    )


def _information(task: Task, target: IdentificationTarget = TARGET) -> np.ndarray:
    R = earlier_root(target, task)
    return R.T @ R


def test_information_adds_in_any_order() -> None:
    rng = np.random.default_rng(0)
    earlier = [_result(rng) for _ in range(3)]
    rows = np.vstack([one.factors[0] for one in earlier])
    for order in itertools.permutations(earlier):
        P = _information(TASK.changed(after=order, noise=1.0))
        assert np.allclose(P, rows.T @ rows, rtol=1e-10)
        assert np.array_equal(P, _information(TASK.changed(after=tuple(earlier), noise=1.0)))  # to the last digit


def test_one_run_of_a_design_is_its_weighted_rows(short_design: excite.Design) -> None:
    task = short_design.task.changed(noise=(0.5, 1.0, 2.0))
    samples = short_design.trajectory.samples(TARGET.model.times(task.trajectory.period, task.output.rate))
    W = TARGET.model.assemble(samples)[:, TARGET.base.index] / np.tile([0.5, 1.0, 2.0], samples.time.size)[:, None]
    after = (earlier_information(short_design),) * 2
    assert np.allclose(_information(task.changed(after=after)), 2 * W.T @ W, rtol=1e-9)


def test_the_criterion_after_a_run_is_that_of_both_runs_rows(short_design: excite.Design) -> None:
    task = short_design.task.changed(noise=(0.5, 1.0, 2.0), weighted=True)
    W = TARGET.model.assemble(short_design.samples)[:, TARGET.base.index]
    first, new = W[:600], W[600:]
    plain = weighting_of(TARGET, task)
    R = np.linalg.qr(plain.rows(first), mode="r")
    one = dataclasses.replace(_result(np.random.default_rng(1)), factors=(R,))
    after = weighting_of(TARGET, task.changed(after=(one,)))
    stacked = plain.rows(np.vstack([first, new]))
    assert np.allclose(after.matrix(new), stacked.T @ stacked / (len(new) // 3), rtol=1e-9)


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_conventions_transform_the_information_as_they_do_rows(convention: str) -> None:
    one = _result(np.random.default_rng(2))
    weighting = weighting_of(TARGET, TASK.changed(after=(one,), base=convention, noise=1.0))
    T, F = TARGET.transforms[convention], one.factors[0]
    none = np.zeros((len(TARGET.model.row_labels), TARGET.base.rank))
    assert np.allclose(weighting.matrix(none), (F @ T).T @ (F @ T), rtol=1e-9)


def test_parameters_of_another_base_are_nuisance_that_earlier_experiments_share() -> None:
    """Offsets that only the earlier model has: the information is the inverse of the covariance of the shared ones."""
    wide = target_of(*robot_and_task(Task("irp6", offset=True)))
    rng = np.random.default_rng(4)
    two = [_result(rng, wide) for _ in range(2)]
    rows = np.vstack([one.factors[0] for one in two])
    shared = [wide.base.names.index(name) for name in TARGET.base.names]
    expected = np.linalg.inv(rows.T @ rows)[np.ix_(shared, shared)]
    assert np.allclose(np.linalg.inv(_information(TASK.changed(after=tuple(two), noise=1.0))), expected, rtol=1e-8)


def test_nothing_is_known_of_parameters_that_only_the_new_base_has() -> None:
    wide = target_of(*robot_and_task(task := Task("irp6", offset=True, noise=1.0)))
    R = earlier_root(wide, task.changed(after=(_result(np.random.default_rng(5)),)))
    unknown = {name for name, s in zip(wide.base.names, deviations_of(R), strict=True) if np.isinf(s)}
    assert unknown == set(wide.base.names) - set(TARGET.base.names)


def test_partial_motions_keep_their_meaning_of_parameters() -> None:
    """Drives 1 and 2 alone: other base parameters, which are combinations of those of the whole motion."""
    part = target_of(*robot_and_task(Task("irp6", drives=("1", "2"))))
    one = _result(np.random.default_rng(6), part)
    A, names = _definition(TARGET)
    A_part, names_part = _definition(part)
    assert names == names_part
    L = A_part @ np.linalg.pinv(A)
    F = one.factors[0] @ L
    assert np.allclose(_information(TASK.changed(after=(one,), noise=1.0)), F.T @ F, atol=1e-8 * np.abs(F.T @ F).max())


def test_estimates_are_weighted_by_their_information(short_design: excite.Design) -> None:
    assert np.all(np.isnan(earlier_estimate(TARGET, TASK.changed(after=(earlier_information(short_design),)))))
    rng = np.random.default_rng(7)
    two = [_result(rng) for _ in range(2)]
    J = [one.factors[0].T @ one.factors[0] for one in two]
    expected = np.linalg.solve(J[0] + J[1], J[0] @ two[0].values + J[1] @ two[1].values)
    assert np.allclose(earlier_estimate(TARGET, TASK.changed(after=tuple(two), noise=1.0)), expected)


def test_noise_keeps_its_density_at_another_rate() -> None:
    one = _result(np.random.default_rng(8))
    slow = noise_in_hand([one], TARGET.model, TASK.changed(rate=100.0))
    assert noise_in_hand([one], TARGET.model, TASK.changed(noise=3.0)) == (3.0,)  # what is stated goes first
    fast = noise_in_hand([one], TARGET.model, TASK.changed(rate=400.0))
    assert np.allclose(np.array(fast) / np.array(slow), np.sqrt(4001 / 1001))
    assert np.allclose(np.array(slow) * np.sqrt(10.0 / 1001), one.density)


def test_noise_of_several_results_is_pooled_by_their_degrees_of_freedom() -> None:
    rng = np.random.default_rng(9)
    two = [dataclasses.replace(_result(rng), degrees_of_freedom=freedom) for freedom in (2, 6)]
    density = np.array(noise_in_hand(two, TARGET.model, TASK)) * np.sqrt(10.0 / 1001)
    assert np.allclose(density**2, (2 * np.array(two[0].density) ** 2 + 6 * np.array(two[1].density) ** 2) / 8)


def test_deviations_are_infinite_where_rows_determine_nothing() -> None:
    R = np.array([[2.0, 0.0, 0.0], [0.0, 1.0, 1.0]])
    assert deviations_of(R).tolist() == [0.5, np.inf, np.inf]
    M = np.random.default_rng(0).standard_normal((9, 4)) * [1e-3, 1.0, 1e3, 1e6]
    assert np.allclose(deviations_of(M), np.linalg.norm(np.linalg.pinv(M, rcond=1e-15), axis=1))


def test_the_kind_says_where_noise_matters(short_design: excite.Design) -> None:
    one = earlier_information(short_design)
    assert one.kind == DESIGN
    double = {name: 2.0 for name, _ in one.equations}
    single = dict.fromkeys(double, 1.0)
    assert np.allclose(np.vstack(one.rows(single)), 2 * np.vstack(one.rows(double)))
    result = _result(np.random.default_rng(11))
    assert np.array_equal(result.rows(single)[0], result.rows(double)[0])
