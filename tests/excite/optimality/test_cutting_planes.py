"""The relaxation on a lift with known bounds: ``tau = m ddq + Fv dq + 10 c (+ Fc sign dq)``."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from excite.optimality import proven_factor
from excite.optimality.bounded_criteria import BOUNDED
from excite.optimality.cutting_planes import CuttingPlanes, DualCertificate
from excite.optimality.limited_states import LimitedStates
from excite.optimality.moment_conditions import MomentConditions
from excite.optimality.proven_factor import ProvenFactor

W = 3.0
K = W * np.arange(1.0, 4.0)
FIRST = K[:1]


@dataclass
class Lift:
    """Rows of a single joint, without a position."""

    coulomb: bool = False
    prior: np.ndarray = field(default_factory=lambda: np.zeros((1, 1)))

    def __call__(self, S: np.ndarray) -> np.ndarray:
        _, v, a = S.T
        columns = [a, v, np.full_like(v, 10.0), *([np.sign(v)] if self.coulomb else [])]
        return np.stack(columns, axis=1)[:, None, :]

    def positions_that_count(self) -> np.ndarray:
        return np.zeros(1, dtype=bool)


def limits(velocity: float = 1.0, acceleration: float = 5.0, highest: float = K[-1]) -> LimitedStates:
    one = np.ones(1)
    return LimitedStates(
        np.ones((1, 1)), -one, one, velocity * one, acceleration * one, highest, np.zeros(1), np.ones(1, dtype=bool)
    )


def motion(a: np.ndarray, b: np.ndarray, count: int = 400) -> np.ndarray:
    t = (np.arange(count) + 0.5) * 2 * np.pi / W / count
    c, s = np.cos(np.outer(t, K)), np.sin(np.outer(t, K))
    return np.stack([c @ a + s @ b, (c * K) @ b - (s * K) @ a, -(c * K**2) @ a - (s * K**2) @ b], axis=1)


def planes(rows: Lift, states: LimitedStates, frequencies: np.ndarray = K) -> CuttingPlanes:
    conditions = MomentConditions(states, np.zeros(1, dtype=bool), frequencies)
    higher = np.array([1.0, 0.2, 0.1]) * (frequencies.size > 1)
    begin = motion(np.array([0.1, 0.0, 0.0]) + 0.02 * higher, 0.1 * higher / K, 100)
    assert np.all(states.hold(begin))
    return CuttingPlanes(rows, states, conditions, begin)  # type: ignore[arg-type]


def bound_of(problem: CuttingPlanes, name: str, rounds: int = 4) -> float:
    relaxed = problem.run(BOUNDED[name], rounds, np.random.default_rng(0))
    return BOUNDED[name].proven(relaxed.multipliers, relaxed.factor)


@pytest.mark.parametrize(
    ("name", "best"),
    [
        ("condition", 10.0 * np.sqrt(2.0)),
        pytest.param("sigma-min", np.sqrt(2.0), marks=pytest.mark.slow),
        pytest.param("logdet", (25.0 * W**2) ** (-1 / 6), marks=pytest.mark.slow),
    ],
)
def test_bounds_of_a_single_harmonic_are_its_optimum(name: str, best: float) -> None:
    """``E dq^2 = V^2 / 2`` and ``E ddq^2 = (w V)^2 / 2`` at best, and the means of both are zero."""
    bound = bound_of(planes(Lift(), limits(highest=W), FIRST), name, 8)
    assert 0.97 * best <= bound <= best * (1 + 1e-6)


def test_bound_with_more_harmonics_is_that_of_the_known_inequalities() -> None:
    """``9 E dq^2 <= E ddq^2 <= 81 (1 - E dq^2)`` gives ``E dq^2 <= 0.9`` without the limit of acceleration."""
    problem = planes(Lift(), limits(acceleration=9.0))
    best = 10.0 / np.sqrt(0.9)
    assert 0.97 * best <= bound_of(problem, "condition") <= best * (1 + 1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("name", BOUNDED)
def test_bounds_hold_for_random_motions(name: str) -> None:
    rows, states = Lift(coulomb=True), limits()
    problem = planes(rows, states)
    bound = bound_of(problem, name)
    rng, values = np.random.default_rng(1), []
    for _ in range(200):
        S = motion(*rng.standard_normal((2, 3)) / K)
        S = S * min(1.0 / np.abs(S[:, 0]).max(), 1.0 / np.abs(S[:, 1]).max(), 5.0 / np.abs(S[:, 2]).max())
        Y = rows(S)[:, 0]
        eigenvalues = np.linalg.eigvalsh(Y.T @ Y / len(Y))
        of = {
            "condition": np.sqrt(eigenvalues[-1] / eigenvalues[0]),
            "sigma-min": eigenvalues[0] ** -0.5,
            "logdet": np.exp(-0.5 * np.log(eigenvalues).mean()),
        }
        values.append(of[name])
    assert bound <= min(values)
    assert bound >= 0.3 * min(values)


@pytest.mark.slow
def test_looser_limits_never_raise_the_bound() -> None:
    bounds = []
    for velocity, acceleration in ((0.6, 3.0), (0.8, 3.0), (0.8, 6.0)):
        problem = planes(Lift(coulomb=True), limits(velocity, acceleration))
        bounds.append(bound_of(problem, "condition"))
    assert bounds[1] <= bounds[0] * 1.01  # to the gap at which the search for states ends
    assert bounds[2] <= bounds[1] * 1.01


def test_dense_sampling_finds_no_state_beyond_what_is_proven() -> None:
    problem = planes(Lift(coulomb=True), limits())
    relaxed = problem.run(BOUNDED["condition"], 4, np.random.default_rng(0))
    certificate = DualCertificate(problem.rows, problem.conditions, relaxed.multipliers)
    factor = ProvenFactor(certificate, problem.states).run(relaxed.factor, 0, lambda _: None)
    assert factor is not None
    v, a = (x.ravel() for x in np.meshgrid(np.linspace(-1, 1, 401), np.linspace(-5, 5, 401)))
    S = np.stack([np.zeros_like(v), v, a], axis=1)
    sampled = certificate.ratios(S[problem.states.hold(S)]).max()
    assert sampled <= factor <= 1.3 * sampled


def test_what_interpolation_between_corners_may_miss_is_added(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a form that is quadratic in the positions it is the difference in the middle of a cell."""
    added: list[np.ndarray] = []
    certificates = SimpleNamespace(factor=lambda Q, D, fastest: float(added.append(Q) is not None))
    monkeypatch.setattr(proven_factor, "SumOfSquares", lambda *_: certificates)
    curvature, widths = np.random.default_rng(0).uniform(0.0, 2.0, (2, 3, 3)), np.array([0.3, 0.7])
    curvature, nothing = curvature + curvature.transpose(0, 2, 1), np.zeros((1, 3, 3))
    pattern = SimpleNamespace(
        curvature=lambda *_: (curvature, 0 * curvature), matrices=lambda *_: (nothing,) * 3, signs=None,
        functions=np.arange(3),
    )  # fmt: skip
    states: Any = SimpleNamespace(velocity=np.ones(3), acceleration=np.ones(3), bandwidth=None)
    grid = proven_factor._Grid(np.zeros((1, 2)), widths[None], np.ones((1, 3)), np.eye(2))
    ProvenFactor(None, states)._of_pattern(pattern, grid, 1.0, 0)  # type: ignore[arg-type]
    corners = widths / 2 * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
    missed = np.mean([np.einsum("a,aij->ij", p**2 / 2, curvature) for p in corners], axis=0)  # zero in the middle
    np.testing.assert_allclose(added[0], np.diag(missed.sum(axis=1)))
