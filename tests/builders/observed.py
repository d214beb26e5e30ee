"""Observations of known parameters, in rows and in blocks, for the tests of estimators and choices."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from excite.identification.choices.left_out import BlockStatistics
from excite.identification.observations import Observations
from regressors.models.base import Base, base_parameters, random_states
from regressors.models.differential import DifferentialModel
from regressors.models.model import RegressorModel
from regressors.models.nominal import parameter_values, standard_values
from regressors.readers.library import built_in
from regressors.samples import Array


def observations_of(
    W: Array, y: Array, equations: int = 1, logs: int = 1, known: Sequence[float] | None = None, step: float = 0.01
) -> Observations:
    """Rows by instants, equations within each, split evenly over the logs."""
    m, p = W.shape
    instants = m // equations
    log = np.repeat(np.arange(instants) * logs // max(instants, 1), equations)
    noise = None if known is None else np.tile(np.asarray(known, dtype=float), (logs, 1))
    return Observations(
        W,
        y,
        tuple(f"b{k}" for k in range(1, p + 1)),
        ("kg m^2",) * p,
        np.tile(np.arange(equations), instants),
        tuple((f"joint{k}", "Nm") for k in range(1, equations + 1)),
        log,
        tuple(f"log{k}" for k in range(1, logs + 1)),
        np.repeat(np.arange(instants) * step, equations),
        noise,
    )


def noise_of(rng: np.random.Generator, deviations: Sequence[float], instants: int) -> Array:
    """Independent normal noise, one standard deviation per equation, shape (instants * equations,)."""
    return (rng.normal(size=(instants, len(deviations))) * np.asarray(deviations)).ravel()


def random_problem(
    seed: int, instants: int = 60, p: int = 4, deviations: Sequence[float] = (0.2, 1.5), logs: int = 1
) -> tuple[Observations, Array]:
    """Random regressor with columns of different size, and the true parameters."""
    rng = np.random.default_rng(seed)
    W = rng.normal(size=(instants * len(deviations), p)) * 10.0 ** np.linspace(-1.0, 2.0, p)
    beta = rng.normal(size=p)
    y = W @ beta + noise_of(rng, deviations, instants)
    return observations_of(W, y, len(deviations), logs), beta


@cache
def robot_model(name: str) -> tuple[RegressorModel, Base, dict[str, float]]:
    """Differential model of a built-in robot, its base, and every standard parameter; friction where not known 0.3."""
    robot = built_in(name)
    model = DifferentialModel(robot)
    friction = {parameter: 0.3 for parameter in model.definition()[1] if parameter.startswith("F")}
    return model, base_parameters(model), {**friction, **standard_values(robot)}


def robot_observations(name: str, noise: float, seed: int = 0, count: int = 150) -> tuple[Observations, Array]:
    """Torques at random states, with noise relative to each joint's torques, and the true base parameters."""
    model, base, known = robot_model(name)
    beta = parameter_values(model, base, known)
    states = random_states(model.robot, count, seed=seed + 100)
    W = model.assemble(states)[:, base.index]
    n = model.robot.n
    exact = W @ beta
    deviations = noise * np.sqrt(np.mean(exact.reshape(-1, n) ** 2, axis=0))
    y = exact + noise_of(np.random.default_rng(seed), deviations, count)
    observations = Observations(
        W,
        y,
        base.names,
        base.units,
        np.tile(np.arange(n), count),
        model.row_labels,
        np.zeros(y.size, dtype=np.intp),
        ("states",),
        np.repeat(states.time, n),
    )
    return observations, beta


def random_blocks(
    seed: int, columns: int = 4, equations: int = 3, instants: int = 300, blocks: int = 5, noise: float = 0.1
) -> tuple[Array, Array, Array, Array]:
    """W, y, block of each instant, and the true parameters; the equations differ in size and in noise."""
    rng = np.random.default_rng(seed)
    W = rng.normal(size=(instants, equations, columns)) * 10.0 ** rng.uniform(-2, 2, columns)
    beta = rng.normal(size=columns) / np.abs(W).mean(axis=(0, 1))
    sizes = 3.0 ** np.arange(equations)
    W *= sizes[:, None]
    y = W @ beta + noise * sizes * rng.uniform(0.3, 1.0, equations) * rng.normal(size=(instants, equations))
    block = np.repeat(np.arange(blocks), -(-instants // blocks))[:instants]
    return W, y, np.where(rng.random(instants) < 0.1, -1, block), beta


def statistics_of(W: Array, y: Array, block: Array, *more: tuple[Array, Array, Array]) -> BlockStatistics:
    """Of one log, or of more."""
    Ws, ys, blocks = zip((W, y, block), *more, strict=True)
    rows = [[(np.arange(one.shape[2]), each) for each in one.transpose(1, 2, 0)] for one in Ws]
    return BlockStatistics.of(rows, ys, blocks, W.shape[2])


def slow_squares(W: Array, y: Array, block: Array, weights: Array) -> Array:
    """Squared errors in each block of the weighted least squares of the others' rows, shape (B, r)."""
    squares = []
    for number in sorted(set(block[block >= 0].tolist())):
        others = (block >= 0) & (block != number)
        root = np.sqrt(weights)
        rows = (W[others] * root[:, None]).reshape(-1, W.shape[2])
        length = np.linalg.norm(rows, axis=0)
        length[length == 0] = 1.0
        beta = np.linalg.lstsq(rows / length, (y[others] * root).reshape(-1), rcond=None)[0] / length
        squares.append(np.sum((y[block == number] - W[block == number] @ beta) ** 2, axis=0))
    return np.array(squares)
