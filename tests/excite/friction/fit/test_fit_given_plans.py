"""Friction fitted to a plan however it is given: the plan itself, its folder, or what was simulated of its files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import excite
from excite.simulation.simulate import motion_source
from regressors.errors import InputError, UnknownName


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Path, Any]:
    """A plan of drive z1, its folder, and the simulation of its file."""
    folder = tmp_path_factory.mktemp("plan")
    schedule = excite.Schedule(percent=(20.0, 60.0), warm_up=0.0)
    plan = excite.plan_friction("irp6", schedule, drives=["z1"], torque_ramp=[0.0])
    plan.save(folder)
    simulation = excite.simulate(folder / "z1.csv", noise=0.1, seed=1, controller="pd", rate=100.0)
    return plan, folder, simulation


def curve(plan: Any, simulation: Any) -> np.ndarray:
    fit = excite.fit_friction("irp6", simulation, plan=plan, model="coulomb-viscous")
    (found,) = fit.characteristics
    assert found.drive == "z1"
    return np.asarray(found.fit.values)


@pytest.mark.slow
def test_every_form_of_a_plan_gives_the_same_curve(played: tuple[Any, Path, Any]) -> None:
    plan, folder, simulation = played
    expected = curve(folder, simulation)
    for given in (plan, str(folder), simulation, motion_source(folder / "z1.csv")):
        np.testing.assert_allclose(curve(given, simulation), expected, rtol=1e-12)
    assert expected[0] == pytest.approx(28.0, rel=0.2)


@pytest.mark.slow
def test_a_plan_is_simulated_without_its_folder(played: tuple[Any, Path, Any], tmp_path: Path) -> None:
    plan, _, simulation = played
    again = excite.simulate(plan.motion("z1"), noise=0.1, seed=1, controller="pd", rate=100.0)
    np.testing.assert_allclose(again.log.q, simulation.log.q, atol=1e-9)
    np.testing.assert_allclose(again.log.effort, simulation.log.effort, atol=1e-6)
    again.save(tmp_path / "run.csv")
    np.testing.assert_allclose(curve(plan, tmp_path / "run.csv"), curve(plan, simulation), rtol=1e-6)
    with pytest.raises(UnknownName, match="no coordinate of the plan named 'q1'; available: z1"):
        plan.motion("q1")


@pytest.mark.slow
def test_what_is_no_plan_is_refused(played: tuple[Any, Path, Any]) -> None:
    plan, _, simulation = played
    design = excite.design_trajectory(excite.Task("irp6", harmonics=2, starts=1, executor="serial"))
    other = excite.simulate(design, rate=100.0)
    with pytest.raises(InputError, match="expected a friction plan, given a motion that comes from none"):
        excite.fit_friction("irp6", simulation, plan=other)
    with pytest.raises(InputError, match="the plan is a plan for irp6, not for panda"):
        excite.fit_friction("panda", [], plan=plan)
    with pytest.raises(UnknownName, match="no drive in the plan named 'z2'; available: z1"):
        excite.fit_friction("irp6", simulation, plan=plan, drives=["z2"])
