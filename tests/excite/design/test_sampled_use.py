"""Where a search looks at nonlinear limits: nothing that the whole grid shows is overlooked."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from constraints.nonlinear import NonlinearConstraint
from constraints.power import tool_box, tool_speed
from constraints.torque import torque_limits
from excite.design.formulation import formulate
from excite.design.grid_limits import GridConstraint, GridJoints
from excite.design.initial_guesses import random_motion
from excite.design.problem import Problem
from excite.design.solvers.limit_rows import NearRows
from excite.tasks.task import Task
from regressors.models.nominal import standard_values
from regressors.models.partial import of_joints
from regressors.readers.library import built_in
from regressors.samples import Array

PANDA = built_in("panda")
FAMILIES = ("fourier", "bspline", "fourier-quintic")


@cache
def problem(family: str) -> Problem:
    return formulate(PANDA, Task("panda", trajectory=family, torque_margin="none", executor="serial")).problem


@cache
def limits(family: str) -> tuple[GridConstraint, ...]:
    joints = GridJoints(problem(family).limits.linear[0].grid, of_joints(PANDA, range(PANDA.n)))
    kinds: tuple[NonlinearConstraint, ...] = (
        *torque_limits(PANDA, standard_values(PANDA), 0.5),
        tool_box(PANDA, np.zeros(3), np.array([-0.4, -0.4, 0.2]), np.array([0.5, 0.5, 1.0])),
        tool_speed(PANDA, np.zeros(3), 1.0),
    )
    return tuple(GridConstraint.on_joints(kind, joints) for kind in kinds)


def motions(family: str, count: int) -> list[Array]:
    """Random motions, drawn towards the centre until each uses about all of a limit at its peak."""
    rng, near = np.random.default_rng(5), []
    for k in range(count):
        limit, x = limits(family)[k % 3], random_motion(problem(family), rng)
        parts = [problem(family).drawn(x, part) for part in np.linspace(0.02, 1.0, 25)]
        peaks = [abs(limit.uses(limit.values(x)).max() - 1.0) for x in parts]
        near.append(parts[int(np.argmin(peaks))])
    return near


@pytest.mark.parametrize("family", FAMILIES)
def test_a_search_overlooks_no_peak_of_the_grid(family: str) -> None:
    """Its largest use is that of the whole grid wherever this is near a bound, and values are those of the grid."""
    looked, tight = 0, 0
    for x in motions(family, 15):
        for limit in limits(family):
            sampled, values = limit.sampled(x), limit.values(x)
            np.testing.assert_allclose(sampled.values, values[:, sampled.instants], atol=1e-12)
            np.testing.assert_allclose(sampled.use, limit.uses(values)[:, sampled.instants], atol=1e-12)
            assert np.all(np.diff(sampled.instants) > 0)
            most = limit.uses(values).max()
            assert limit.holds(x) == (most <= 1.0)
            if most > 0.95:
                assert sampled.use.max() == pytest.approx(most, abs=1e-12)
                tight += 1
            looked += sampled.instants.size < values.shape[1]
    assert tight > 5
    assert looked > 10


def test_a_motion_is_evaluated_once_for_all_that_ask(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []
    (limit, *_), x = limits("fourier"), motions("fourier", 1)[0]
    evaluate = type(limit.function.constraint).at_instants
    monkeypatch.setattr(
        type(limit.function.constraint), "at_instants", lambda *given: calls.append(given) or evaluate(*given)
    )
    for _ in range(3):
        limit.sampled(0.9 * x)
    first = len(calls)
    assert 1 <= first <= 2  # the coarse instants, and those between them
    limit.sampled(x)
    assert len(calls) > first


def test_rows_of_the_programme_forbid_what_they_linearise() -> None:
    """A step that the rows allow keeps the linearised limits; one that breaks them adds rows."""
    x, rng = motions("fourier", 1)[0], np.random.default_rng(6)
    inside = problem("fourier").drawn(x, 0.98)
    near = NearRows(limits("fourier"), inside)
    before = len(near.rows()[0])
    assert not near.broken(np.zeros(x.size))
    step = rng.normal(size=x.size)
    step *= np.sign(step @ (x - inside).ravel())
    while not near.broken(step):
        step *= 1.5
    A, lower, upper = near.rows()
    assert len(A) > before
    assert np.any((A @ step > upper) | (A @ step < lower))
    assert not near.broken(step)  # nothing new
    assert np.all(lower <= 0.0)
    assert np.all(upper >= 0.0)
