"""Motion that identified servos make of commands: against the equation of motion, gradients, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from servo_arm import JOINTS, small_arm, true_servos
from written_files import saved

import excite
from excite.design.formulation import formulate
from excite.identification.servo_result import MotionFit, ServoResult, task_servos
from excite.information.tracking import LinearServos
from excite.tasks.robot_of_task import robot_and_task
from excite.tasks.stored_files import TaskServos, UnopenedFile
from excite.tasks.task import Task
from excite.trajectories import Fourier
from regressors.errors import InputError
from regressors.models.partial import PartialMotion
from regressors.models.servo_response import SYMBOLS
from regressors.samples import Samples

K, D, J, DELAY, PERIOD = 15.0, 0.6, 0.02, 0.03, 4.0
ONE = LinearServos(*(np.array([value]) for value in (K, D, J, DELAY)), PERIOD)
QUICK: dict[str, Any] = {"joints": JOINTS, "harmonics": 4, "period": PERIOD, "starts": 1, "seed": 0}


def servos(**changed: float) -> ServoResult:
    fits = tuple(MotionFit(joint, "rad", 1e-3, 0.1, 0.05, 0.03, 1e-3, 1.0) for joint in JOINTS)
    return replace(true_servos(**changed), fits=fits)


def task(**options: Any) -> Task:
    return Task(small_arm(), **{"model": "servo", **QUICK, **options})


def test_a_command_is_followed_as_the_equation_of_motion_says() -> None:
    family = Fourier(PERIOD, 3)
    x = np.random.default_rng(0).normal(0.0, 0.3, (1, family.size))

    def told(t: float) -> float:
        return float(family.motion(x, np.array([(t - DELAY) % PERIOD]), 0)[0, 0])

    time = np.linspace(0.0, PERIOD, 401)
    last = solve_ivp(
        lambda t, y: [y[1], (K * (told(t) - y[0]) - D * y[1]) / J], (0.0, 4 * PERIOD), [0.0, 0.0],
        t_eval=3 * PERIOD + time, rtol=1e-9, atol=1e-11, max_step=0.01,
    )  # fmt: skip
    command = Samples(time, *(family.motion(x, time, d) for d in range(4)))
    followed = ONE.samples(command)
    np.testing.assert_allclose(followed.q[:, 0], last.y[0], atol=1e-6)
    np.testing.assert_allclose(followed.dq[:, 0], last.y[1], atol=1e-5)
    assert np.abs(followed.q - command.q).max() > 0.03


def test_gradients_are_those_of_finite_differences() -> None:
    family, count = Fourier(PERIOD, 3), 40
    told = family.joints(family.grid(count), PartialMotion(("q",), ("q",), np.eye(1), np.zeros(1)))
    motion, rng = ONE.motion(told, count), np.random.default_rng(1)
    x, step = (rng.normal(0.0, 0.3, (1, family.size)) for _ in range(2))
    weights = [rng.normal(size=(1, count)) for _ in range(3)]

    def value(x: Any) -> float:
        return sum(float((w * each).sum()) for w, each in zip(weights, motion.values(x), strict=True))

    slope = (value(x + 1e-4 * step) - value(x - 1e-4 * step)) / 2e-4
    assert float((motion.pullback(x, weights) * step).sum()) == pytest.approx(slope, rel=1e-9)


def test_stiff_servos_are_designed_for_as_if_there_were_none() -> None:
    stiff = servos(K=1e5, D=1e2, J=1e-6, d=0.0)
    plain, followed = (formulate(small_arm(), task(**more)).problem for more in ({}, {"servos": stiff}))
    x = plain.enlarged(np.random.default_rng(2).normal(size=plain.rest.shape), 0.5, 1.0)
    assert followed.exact_value(x) == pytest.approx(plain.exact_value(x), rel=1e-3)
    soft = formulate(small_arm(), task(servos=servos(D=3.0))).problem
    assert soft.exact_value(x) > plain.exact_value(x) + 0.1


def test_a_design_counts_the_tracked_motion_and_its_files_hold_the_servos(tmp_path: Path) -> None:
    slow = servos(D=3.0)
    folder = saved(tmp_path / "servos", slow)
    plain = excite.design_trajectory(small_arm(), model="servo", **QUICK)
    aware = excite.design_trajectory(small_arm(), model="servo", servos=str(folder), **QUICK)
    problem = formulate(*robot_and_task(aware.task)).problem
    assert problem.exact_value(aware.trajectory.x) == pytest.approx(aware.minimised_value, rel=1e-9)
    assert aware.minimised_value < problem.exact_value(plain.trajectory.x) - 0.01
    loaded = excite.load_design(saved(tmp_path / "design", aware))
    assert loaded.task.objective.servos.values == task_servos(slow).values
    assert loaded.feasible


BAD: tuple[tuple[dict[str, Any], str], ...] = (
    ({"model": "energy", "servos": servos()}, "single instants"),
    ({"servos": TaskServos("a", ("x",), ((1.0,) * len(SYMBOLS),), (1e-3,))}, "lift, elbow, roll"),
    ({"servos": UnopenedFile("servos", "elsewhere")}, "only named"),
    ({"servos": object()}, "expected identified servos"),
    ({"servos": 3}, "servos: expected the name of a file, or its content, given 3"),
    ({"servos": "nowhere"}, "nowhere"),
)


def test_what_is_refused() -> None:
    for options, message in BAD:
        with pytest.raises((InputError, OSError), match=message):
            formulate(small_arm(), task(**options)).problem  # noqa: B018
    with pytest.raises(InputError, match="each of 2 joints"):
        TaskServos("a", ("x", "y"), ((1.0,),), (0.0,))
