"""The relaxation whose dual bounds every motion: moment conditions, sums of squares, cutting planes."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from excite.optimality import proven_factor
from excite.optimality.cutting_planes import BOUNDED, CuttingPlanes
from excite.optimality.limited_states import LimitedStates, MomentConditions, matrix_of, triangle
from excite.optimality.proven_factor import SumOfSquares, monomials
from excite.registry import instance

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
    return CuttingPlanes(rows, conditions, begin)


def bound_of(problem: CuttingPlanes, name: str, rounds: int = 4) -> float:
    return BOUNDED[name].proven(*[*problem.improving(BOUNDED[name], rounds, np.random.default_rng(0))][-1])


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
    bound = bound_of(planes(rows, states), name)
    rng, values = np.random.default_rng(1), []
    for _ in range(200):
        S = motion(*rng.standard_normal((2, 3)) / K)
        S = S * min([1.0, 1.0, 5.0] / np.abs(S).max(axis=0))
        Y = rows(S)[:, 0]
        values.append(instance("criterion", name).value(Y.T @ Y / len(Y)))
    assert 0.3 * min(values) <= bound <= min(values)


def test_dense_sampling_finds_no_state_beyond_what_is_proven() -> None:
    problem = planes(Lift(coulomb=True), limits())
    *_, (certificate, largest) = problem.improving(BOUNDED["condition"], 4, np.random.default_rng(0))
    factor = proven_factor.proven_factor(certificate, largest, 0, lambda _: None)
    assert factor is not None
    v, a = (x.ravel() for x in np.meshgrid(np.linspace(-1, 1, 401), np.linspace(-5, 5, 401)))
    S = np.stack([np.zeros_like(v), v, a], axis=1)
    sampled = certificate.ratios(S[problem.states.hold(S)]).max()
    assert sampled <= factor <= 1.3 * sampled


def test_what_interpolation_between_corners_may_miss_is_added(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a form that is quadratic in the positions it is the difference in the middle of a cell."""
    added: list[np.ndarray] = []
    serves = SimpleNamespace(serves=lambda M, _: np.ones(len(M), dtype=bool))
    certificates = SimpleNamespace(rest=lambda M, _: added.append(-M) or serves)
    monkeypatch.setattr(proven_factor, "SumOfSquares", lambda *_: certificates)
    curvature, widths = np.random.default_rng(0).uniform(0.0, 2.0, (2, 3, 3)), np.array([0.3, 0.7])
    curvature, nothing = curvature + curvature.transpose(0, 2, 1), np.zeros((1, 3, 3))
    states = SimpleNamespace(velocity=np.ones(3), acceleration=np.ones(3), bandwidth=None)
    pattern: Any = SimpleNamespace(
        curvature=lambda *_: (curvature, 0 * curvature), matrices=lambda *_: (nothing,) * 3, signs=None,
        functions=np.arange(3), states=states,
    )  # fmt: skip
    proven_factor.of_pattern(pattern, (np.zeros((1, 2)), widths[None], np.ones((1, 3)), np.eye(2)), 1.0, 1.0, 0)
    corners = widths / 2 * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
    missed = np.mean([np.einsum("a,aij->ij", p**2 / 2, curvature) for p in corners], axis=0)  # zero in the middle
    np.testing.assert_allclose(added[0], np.diag(missed.sum(axis=1)))


OMEGA, HARMONICS = 0.7, 4
R, V, A = np.array([1.0, 0.6]), np.array([1.2, 0.9]), np.array([2.0, 1.7])


def states(bandwidth: float | None) -> LimitedStates:
    D = np.array([[1.0, 0.0], [1.0, 1.0]])
    return LimitedStates(D, -R, R, V, A, bandwidth, np.zeros(2), np.ones(2, dtype=bool))


def limited_motion(seed: int, count: int = 4000) -> np.ndarray:
    """States of a random trigonometric polynomial, scaled into the limits of `states`, at equal steps."""
    rng = np.random.default_rng(seed)
    t = (np.arange(count) + 0.5) * 2 * np.pi / OMEGA / count
    k = np.arange(1, HARMONICS + 1) * OMEGA
    a, b = rng.standard_normal((2, HARMONICS, 2)) / k[:, None]
    phase = np.outer(t, k)
    y = np.cos(phase) @ a + np.sin(phase) @ b
    dy = (-np.sin(phase) * k) @ a + (np.cos(phase) * k) @ b
    ddy = -(np.cos(phase) * k**2) @ a - (np.sin(phase) * k**2) @ b
    D = states(None).directions
    largest = max(np.abs(part @ D.T / bound).max() for part, bound in ((y, R), (dy, V), (ddy, A)))
    return np.hstack([y, dy, ddy]) * (0.999 / largest)


def test_vectors_have_the_inner_product_of_matrices() -> None:
    rng = np.random.default_rng(0)
    A, B = (M + M.T for M in rng.standard_normal((2, 5, 5)))
    assert triangle(A) @ triangle(B) == pytest.approx(np.trace(A @ B))
    np.testing.assert_allclose(matrix_of(triangle(A), 5), A)


@np.errstate(invalid="raise")
def test_drawn_states_are_inside_and_reach_the_limits() -> None:
    band = states(HARMONICS * OMEGA)
    drawn = band.drawn(2000, np.random.default_rng(1))
    assert np.all(band.hold(drawn))
    assert np.abs(drawn[:, 4:] @ band.directions.T / A).max() == pytest.approx(1.0, abs=1e-3)
    few, more = (states(bandwidth).hold(states(None).drawn(4000, np.random.default_rng(0))) for bandwidth in (1.0, 3.0))
    assert np.all(more[few])  # a lower bandwidth admits fewer
    assert 0 < few.sum() < more.sum() < 4000
    endless = np.array([np.inf, 0.6])  # a joint that turns without end
    free = replace(band, low=-endless, high=endless)
    drawn = free.drawn(200, np.random.default_rng(2))
    assert np.ptp(drawn[:, 0]) > 2.0 * R[0]
    assert np.all(free.hold(drawn))


@pytest.mark.parametrize("seed", range(8))
def test_motions_pass_admissible_states_whose_derivatives_have_mean_zero(seed: int) -> None:
    S = limited_motion(seed)
    assert np.all(states(HARMONICS * OMEGA).hold(S))
    h = MomentConditions(states(None), np.ones(2, dtype=bool), np.zeros(0)).values(S)
    np.testing.assert_allclose(h.mean(axis=0), 0.0, atol=2e-3)  # kinks of |dz| between instants
    assert np.all(np.abs(h).max(axis=0) > 0.01)


@pytest.mark.parametrize("seed", range(4))
def test_admitted_multipliers_have_a_mean_of_one_sign_over_every_motion(seed: int) -> None:
    conditions = MomentConditions(
        states(HARMONICS * OMEGA), np.ones(2, dtype=bool), OMEGA * np.arange(1.0, HARMONICS + 1)
    )
    rng = np.random.default_rng(100 + seed)
    drawn = rng.standard_normal(conditions.values(limited_motion(0)[:1]).shape[1])
    drawn[len(conditions.cone()) :] = 0.0
    unit = np.concatenate([triangle(np.eye(7)[None])[0], np.zeros(drawn.size - 28)])
    admitted = conditions.admitted(drawn)
    means = [conditions.values(limited_motion(each)).mean(axis=0) for each in range(10)]
    assert min(mean @ admitted for mean in means) >= 0.0
    assert min(mean @ -unit for mean in means) < 0.0 <= min(mean @ conditions.admitted(-unit) for mean in means)


def test_the_positions_of_a_coordinate_can_be_left_out() -> None:
    counted = np.array([False, True])
    conditions = MomentConditions(states(HARMONICS * OMEGA), counted, OMEGA * np.arange(1.0, HARMONICS + 1))
    S = limited_motion(0)[:50]
    moved = S.copy()
    moved[:, 0] += 1.0
    unit = len(conditions.cone())
    np.testing.assert_allclose(conditions.values(S)[:, :unit], conditions.values(moved)[:, :unit])


FREE, ONE = np.array([np.inf]), np.ones(1)


def entry(size: int, i: int, j: int) -> np.ndarray:
    M = np.zeros((size, size))
    M[i, j] += 0.5
    M[j, i] += 0.5
    return M


# m = (1, v, a, v v)
@pytest.mark.parametrize(
    ("Q", "linked", "highest", "largest"),
    [
        (entry(4, 1, 2), FREE, ONE, 1.0),  # v a
        (entry(4, 1, 2), FREE, ONE / 2, 0.5),
        (entry(4, 1, 1) + entry(4, 2, 2), FREE, ONE, 2.0),  # v^2 + a^2
        (entry(4, 1, 1) + entry(4, 2, 2), ONE, ONE, 1.0),  # with a^2 <= 1 - v^2
        (entry(4, 3, 3) - entry(4, 1, 1), FREE, ONE, 0.0),  # v^4 - v^2
        (entry(4, 1, 1) - entry(4, 3, 3), FREE, ONE, 0.25),  # v^2 - v^4
        (-entry(4, 0, 1), FREE, ONE, 0.0),  # -v, with v >= 0
    ],
)
def test_factor_is_the_largest_value(Q: np.ndarray, linked: np.ndarray, highest: np.ndarray, largest: float) -> None:
    factor = SumOfSquares(ONE, linked).factor(Q, entry(4, 0, 0), highest)
    assert factor == pytest.approx(largest, abs=1e-4)


SIGNS, LINKED = np.array([1.0, -1.0]), np.array([1.5, np.inf])


def sampled(highest: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Monomials of states of those signs up to the highest speeds, within the linked limits."""
    v, a = SIGNS * highest * rng.random((20000, 2)), rng.uniform(-1, 1, (20000, 2))
    inside = a[:, 0] ** 2 <= 1.5 * (1 - v[:, 0] ** 2)
    return monomials(v[inside], a[inside])


def test_factor_bounds_what_is_sampled() -> None:
    rng, certificates = np.random.default_rng(0), SumOfSquares(SIGNS, LINKED)
    m = sampled(np.ones(2), rng)
    for _ in range(5):
        Q, root = rng.standard_normal((2, 8, 8))
        Q, D = Q + Q.T, root @ root.T + np.eye(8)
        most = (np.einsum("ni,ij,nj->n", m, Q, m) / np.einsum("ni,ij,nj->n", m, D, m)).max()
        factor = certificates.factor(Q, D, np.ones(2))
        assert most <= factor <= most + 0.5 * abs(most) + 0.05


def test_a_certificate_serves_positive_matrices_only() -> None:
    rng, highest = np.random.default_rng(0), np.array([0.8, 1.0])
    m = sampled(highest, rng)
    indefinite, served = rng.standard_normal((8, 8)), 0
    M = indefinite + indefinite.T
    M[0, 0] += 1.0 + abs(np.einsum("ni,ij,nj->n", m, M, m).min()) * 1.5
    rest = SumOfSquares(SIGNS, LINKED).rest(M, highest)
    assert np.linalg.eigvalsh(M)[0] < 0.0  # not by itself
    assert rest.serves(M[None], highest[None])[0]
    assert not rest.serves(M[None], np.ones((1, 2)))[0]  # faster than it was made for
    for size in np.linspace(0.0, 2.0, 40):
        changed = M - size * np.outer(*[rng.standard_normal(8)] * 2)
        if rest.serves(changed[None], highest[None])[0]:
            served += 1
            assert np.einsum("ni,ij,nj->n", m, changed, m).min() >= 0.0
    assert 0 < served < 40
