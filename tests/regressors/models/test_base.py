"""Base parameters: what a choice of columns and its dependence say, against exact arithmetic, SciPy and Pinocchio."""

from __future__ import annotations

import re
from fractions import Fraction

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, strategies as st
from public_arms import ARMS, SOME_TREES, Arm, reference
from slow_dynamics import general, three_axes

from regressors.models.base import CHOICES, base_parameters, random_states
from regressors.models.differential import DifferentialModel
from regressors.numerical import independent_columns, pivoted_columns
from regressors.readers.library import built_in
from regressors.readers.urdf import read_urdf
from regressors.robot.columns import Terms
from regressors.robot.robot import Robot, Structure

INERTIAL = Terms.inertial_only()


def irp6_symmetric() -> Robot:
    robot = three_axes()
    return robot.replace(structure=Structure(zero=robot.structure.zero))


MODELS = {
    "irp6": lambda: DifferentialModel(three_axes()),
    "irp6-symmetric": lambda: DifferentialModel(irp6_symmetric()),
    "irp6-general": lambda: DifferentialModel(general(built_in("irp6")), Terms(offset=True)),
    "panda": lambda: DifferentialModel(built_in("panda")),
    "ur10e": lambda: DifferentialModel(built_in("ur10e"), INERTIAL),
    "iiwa7": lambda: DifferentialModel(built_in("iiwa7"), INERTIAL),
}


@pytest.fixture(scope="module", params=MODELS)
def model(request: pytest.FixtureRequest) -> DifferentialModel:
    return MODELS[request.param]()


@pytest.fixture(params=CHOICES)
def choice(request: pytest.FixtureRequest) -> str:
    return request.param


# --- what a base promises --------------------------------------------------------------------------------------------


def test_every_motion_is_explained_by_the_base_columns(model: DifferentialModel, choice: str) -> None:
    """``W = W_b D`` on states that the search did not see, with the identity on the chosen columns."""
    base = base_parameters(model, choice)
    W = model.assemble(random_states(model.robot, 200, seed=123))
    np.testing.assert_allclose(W[:, base.index] @ base.D, W, rtol=1e-9, atol=1e-9 * np.abs(W).max())
    np.testing.assert_array_equal(base.D[:, base.index], np.eye(base.rank))
    assert base.names == tuple(model.names[k] for k in base.index)
    assert base.units == tuple(model.columns[k].unit for k in base.index)


def test_base_columns_are_independent_and_clearly_so(model: DifferentialModel, choice: str) -> None:
    base = base_parameters(model, choice)
    W = model.assemble(random_states(model.robot, 500, seed=77))[:, base.index]
    assert np.linalg.matrix_rank(W / np.linalg.norm(W, axis=0), tol=1e-8) == base.rank
    assert base.gap > 1e8


def test_gap_and_spectrum_are_those_of_the_normalised_columns() -> None:
    model = DifferentialModel(irp6_symmetric())
    states = random_states(model.robot, 300, seed=5)
    base = base_parameters(model, states=states)
    W = model.assemble(states)
    sizes = np.linalg.norm(W, axis=0)
    W = W[:, sizes > 0] / sizes[sizes > 0]
    sigma = np.linalg.svd(W, compute_uv=False)
    np.testing.assert_allclose(base.singular_values[: base.rank], sigma[: base.rank], rtol=1e-10)
    assert base.gap == pytest.approx(base.singular_values[base.rank - 1] / base.singular_values[base.rank])
    full = base_parameters(DifferentialModel(three_axes()))
    assert full.rank == 13
    assert full.gap == np.inf


def test_left_to_right_base_does_not_depend_on_the_random_states(model: DifferentialModel) -> None:
    first = base_parameters(model)
    for seed, count in ((1, 2000), (2, 700)):
        other = base_parameters(model, states=random_states(model.robot, count, seed))
        np.testing.assert_array_equal(other.index, first.index)
        np.testing.assert_allclose(other.D, first.D, rtol=1e-7, atol=1e-7)
        assert other.expressions == first.expressions


def test_left_to_right_base_takes_the_first_columns_that_it_can(model: DifferentialModel) -> None:
    """No column left of a chosen one could have been taken instead: D's row k starts at column index[k]."""
    base = base_parameters(model)
    sizes = np.linalg.norm(model.assemble(random_states(model.robot, 100, seed=6)), axis=0)
    D = base.D * sizes[base.index, None] / np.where(sizes > 0, sizes, np.inf)  # of normalised columns
    for row, start in zip(D, base.index, strict=True):
        np.testing.assert_allclose(row[:start], 0.0, atol=1e-9)


def test_pivoted_base_has_the_largest_columns_and_every_friction_column_that_is_seen() -> None:
    """Inertial and rotor columns are pivoted by size, and rotors behind gears are the largest; friction is not."""
    names = base_parameters(DifferentialModel(general(built_in("irp6")), Terms(reflected=False)), "pivoted").names
    assert set(names) >= {f"Ia{k}" for k in range(1, 6)} | {f"F{k}{kind}" for k in range(1, 6) for kind in "cv"}


def test_orthonormal_factor_has_the_singular_values_of_the_regressor(model: DifferentialModel, choice: str) -> None:
    base = base_parameters(model, choice)
    W = model.assemble(random_states(model.robot, 300, seed=9))
    whole = np.linalg.svd(W, compute_uv=False)
    found = np.linalg.svd(W[:, base.index] @ base.full_rank_factor, compute_uv=False)
    np.testing.assert_allclose(found, whole[: base.rank], rtol=1e-7)
    np.testing.assert_array_equal(base.full_rank_factor, np.tril(base.full_rank_factor))


def test_a_model_that_no_motion_shows_has_no_base_parameter() -> None:
    robot = three_axes()
    zero = frozenset(name for name in DifferentialModel(general(robot), INERTIAL).names if name != "m1")
    base = base_parameters(DifferentialModel(robot.replace(structure=Structure(zero=zero)), INERTIAL))
    assert base.rank == 0
    assert base.names == base.expressions == ()


# --- ranks against Pinocchio -----------------------------------------------------------------------------------------


def pinocchio_rank(arm: Arm, count: int = 60) -> int:
    expected = reference(arm)
    model, data = expected.model, expected.model.createData()
    rng = np.random.default_rng(31)
    blocks = []
    for _ in range(count):
        q = dict(zip(expected.joints, rng.uniform(-2, 2, model.nv), strict=True))
        v, a = rng.uniform(-2, 2, (2, model.nv))
        Y = pin.computeJointTorqueRegressor(model, data, expected.configuration(q), v, a)
        blocks.append(Y.reshape(model.nv, -1))
    W = np.vstack(blocks)
    sizes = np.linalg.norm(W, axis=0)
    W = W[:, sizes > 1e-12 * sizes.max()]
    sigma = np.linalg.svd(W / np.linalg.norm(W, axis=0), compute_uv=False)
    return int(np.sum(sigma > 1e-7 * sigma[0]))


@pytest.mark.parametrize("arm", [*ARMS[::2], *SOME_TREES], ids=str)
def test_rank_equals_that_of_pinocchios_regressor(arm: Arm) -> None:
    model = DifferentialModel(read_urdf(arm.path, base=arm.base, tip=arm.tip, snap_angles=False), INERTIAL)
    rank = pinocchio_rank(arm)
    ranks = {choice: base_parameters(model, choice, rounding=0.0).rank for choice in CHOICES}
    assert ranks == dict.fromkeys(CHOICES, rank)


# --- expressions -----------------------------------------------------------------------------------------------------


def value_of(text: str, names: dict[str, float]) -> tuple[float, float]:
    """Value of a printed expression and the sum of its terms' sizes: terms joined by + and -, factors by spaces."""
    total, size = 0.0, 0.0
    for sign, term in re.findall(r"(^-?|[+-] )(\S+(?: (?![+-] )\S+)*)", text):
        product = 1.0
        for factor in term.split(" "):
            name, _, power = factor.partition("^")
            product *= names[name] ** int(power or 1) if name in names else float(factor)
        total += -product if sign.startswith("-") else product
        size += abs(product)
    return total, size


def test_expressions_mean_the_base_parameters(model: DifferentialModel, choice: str) -> None:
    base = base_parameters(model, choice)
    definition, standard = model.definition()
    rng = np.random.default_rng(17)
    for _ in range(3):
        parameters = rng.uniform(0.5, 1.5, len(standard)) * rng.choice([-1, 1], len(standard))
        names = dict(zip(standard, parameters, strict=True)) | dict(model.robot.constants)
        beta = base.D @ definition @ parameters
        for expression, expected in zip(base.expressions, beta, strict=True):
            found, size = value_of(expression, names)
            assert found == pytest.approx(expected, abs=5e-6 * size), expression  # six digits are printed


def test_expressions_of_the_irp6_are_the_papers() -> None:
    base = base_parameters(DifferentialModel(three_axes()))
    assert base.expressions[:2] == ("I1zz + I2xx + I3yy + n1^2 Ia1", "-I2xx + I2yy + l2^2 m3 + I3xx - I3yy")
    assert base.expressions[6:8] == ("m2c2x + l2 m3", "F1c")
    masses = Terms(coulomb=False, viscous=False)
    five = base_parameters(DifferentialModel(built_in("irp6"), masses)).expressions
    assert "I4xx - I4yy + d5^2 m5 + 2 d5 m5c5z + I5yy" in five
    assert "I4zz + d5^2 m5 + 2 d5 m5c5z + I5yy + n4^2 Ia4" in five
    symmetric = base_parameters(DifferentialModel(irp6_symmetric(), masses))
    assert "m2c2x + l2 m3" in symmetric.expressions
    assert "I3zz + n3^2 Ia3" in symmetric.expressions


# --- the choice of columns, on small matrices ------------------------------------------------------------------------


def exact_rank(columns: list[list[int]]) -> int:
    """Rank of integer columns by elimination over the rationals."""
    rows = [[Fraction(v) for v in row] for row in columns]
    rank = 0
    for k in range(len(rows[0]) if rows else 0):
        pivot = next((r for r in range(rank, len(rows)) if rows[r][k] != 0), None)
        if pivot is None:
            continue
        rows[rank], rows[pivot] = rows[pivot], rows[rank]
        for r in range(rank + 1, len(rows)):
            factor = rows[r][k] / rows[rank][k]
            rows[r] = [a - factor * b for a, b in zip(rows[r], rows[rank], strict=True)]
        rank += 1
    return rank


@st.composite
def integer_matrices(draw: st.DrawFn) -> np.ndarray:
    """Products of small integer matrices, so that most are short of rank; zero columns occur too."""
    k, r, p = draw(st.integers(1, 7)), draw(st.integers(0, 4)), draw(st.integers(1, 7))
    entries = st.integers(-3, 3)
    A = draw(st.lists(entries, min_size=k * r, max_size=k * r))
    B = draw(st.lists(entries, min_size=r * p, max_size=r * p))
    return (np.array(A).reshape(k, r) @ np.array(B).reshape(r, p)).astype(int)


@given(integer_matrices())
def test_independent_columns_are_those_that_raise_the_rank(A: np.ndarray) -> None:
    columns = A.T.tolist()
    raised = [j for j in range(A.shape[1]) if exact_rank(columns[: j + 1]) > exact_rank(columns[:j])]
    found = independent_columns(A.astype(float))
    assert found.tolist() == raised
    assert len(found) == np.linalg.matrix_rank(A)


def test_a_column_counts_by_what_projection_leaves_of_it() -> None:
    for part, chosen in ((1e-7, [0, 1]), (1e-9, [0])):
        R = np.array([[1.0, 1.0], [0.0, part]])
        assert independent_columns(R).tolist() == chosen
        assert independent_columns(R * [1.0, 1e-4]).tolist() == chosen  # of a small column, too
    assert independent_columns(np.array([[1.0, 1.0], [0.0, 1e-3]]), tolerance=1e-2).tolist() == [0]
    assert independent_columns(np.zeros((3, 2))).tolist() == []


@given(integer_matrices())
def test_pivoted_columns_each_leave_most(A: np.ndarray) -> None:
    """Oracle: the distance of every column from the span of those chosen, by least squares."""
    A = A.astype(float)
    found = pivoted_columns(A).tolist()
    assert len(found) == len(set(found)) == np.linalg.matrix_rank(A)
    for k, column in enumerate(found):
        span = A[:, found[:k]]
        explained = span @ np.linalg.lstsq(span, A, rcond=None)[0] if k else np.zeros_like(A)
        left = np.linalg.norm(A - explained, axis=0)
        assert left[column] >= (1 - 2e-6) * left.max()
        assert not np.any(left[:column] > left[column] * (1 + 1e-9) + 1e-9)  # the leftmost of the largest


def test_of_equal_columns_the_leftmost_is_taken_whatever_the_rounding() -> None:
    for seed in range(10):
        Q = np.linalg.qr(np.random.default_rng(seed).normal(size=(6, 6)))[0]
        assert pivoted_columns(3.0 * Q[:, :4]).tolist() == [0, 1, 2, 3]


def test_random_states_fill_the_limits_and_nothing_more() -> None:
    robot = built_in("panda")
    states = random_states(robot, 4000, seed=3)
    limits = robot.limits
    for values, lower, upper in (
        (states.q, limits.lower, limits.upper),
        (states.dq, -limits.velocity, limits.velocity),
        (states.ddq, -limits.acceleration, limits.acceleration),
    ):
        assert np.all((values >= lower) & (values <= upper))
        span = upper - lower
        assert np.all(values.min(axis=0) < lower + 0.01 * span)
        assert np.all(values.max(axis=0) > upper - 0.01 * span)
    again, other = random_states(robot, 4000, seed=3), random_states(robot, 4000, seed=4)
    np.testing.assert_array_equal(again.q, states.q)
    assert not np.array_equal(other.q, states.q)
