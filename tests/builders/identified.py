"""Results of known parameters, as if identified without error, for the tests of exported models."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import excite
from excite.identification.estimator import Estimate
from excite.identification.identification import Identification, torque_target
from excite.identification.prediction import instantaneous_target
from excite.identification.recipe import Recipe
from excite.identification.result import FitFacts
from excite.information.target import IdentificationTarget
from excite.tasks.task import Task
from regressors.models.base import Base
from regressors.models.nominal import standard_values
from regressors.robot.columns import ROTOR
from regressors.robot.inertia import from_centre_of_mass, from_pseudo_inertia, parameter_names, pseudo_inertia
from regressors.robot.robot import Link, Robot
from regressors.samples import Array, Samples

DRIVES = {
    "Ia": 1e-4,
    "c": 0.7,
    "v": 0.4,
    "o": 0.3,
    "l": 0.02,
    "r": 0.2,
    "a": 0.1,
    "s": 0.15,
}  # where the description says nothing of them


def true_standard(target: IdentificationTarget, seed: int = 0) -> dict[str, float]:
    """Bodies near the described ones, or random ones, with the zeros of the structure; drives as described."""
    rng = np.random.default_rng(seed)
    robot = target.robot
    known = standard_values(robot)
    values = {}
    for column in target.model.standard_columns:
        ending = "Ia" if column.kind == ROTOR else column.name[-1]
        values[column.name] = known.get(column.name, DRIVES.get(ending, 0.0) * rng.uniform(0.5, 1.5))
    for number, body in zip(robot.body_numbers, robot.bodies, strict=True):
        F = np.eye(4) + 0.05 * rng.normal(size=(4, 4))
        J = _random_body(rng) if body.theta is None or not np.any(body.theta) else pseudo_inertia(body.theta)
        if not robot.structure.zero:
            J = F @ J @ F.T
        values |= dict(zip(parameter_names(number), from_pseudo_inertia(J).tolist(), strict=True))
    return values


def _random_body(rng: np.random.Generator) -> Array:
    x = np.column_stack([rng.normal(size=(6, 3)) * 0.1 + rng.normal(size=3) * 0.1, np.ones(6)])
    return x.T @ np.diag(rng.uniform(0.1, 1.0, 6)) @ x


def result_of(
    robot: Robot,
    folder: Path,
    standard: Mapping[str, float] | None = None,
    *,
    change: Mapping[str, float] | None = None,
    recipe: Recipe | None = None,
    **options: Any,
) -> Identification:
    """A result whose base parameters are those of given standard ones, some of them changed by a factor."""
    task, recipe = Task(robot.name, **options), Recipe(sign_width=0.0) if recipe is None else recipe
    target = instantaneous_target(robot, task, recipe)
    values = true_standard(target) if standard is None else dict(standard)
    definition, names = target.model.definition()
    beta = target.base.D @ definition @ np.array([values.get(name, 0.0) for name in names])
    base = target.base
    fit = beta * [(change or {}).get(name, 1.0) for name in base.names]
    return identified(robot, task, recipe, base_estimate(base, beta, fit), folder, base=base)


def base_estimate(base: Base, values: Array, fit: Array) -> Estimate:
    """An estimate whose deviations are 0.01, and whose covariances are not known."""
    covariance = np.full((len(base.names),) * 2, np.nan)
    np.fill_diagonal(covariance, 0.01**2)
    return Estimate("weighted", base.names, base.units, values, covariance, np.zeros((0, 0)), 10**9, fit=fit)


def identified(
    robot: Robot, task: Task, recipe: Recipe, estimate: Estimate, folder: Path, *, base: Base | None = None
) -> Identification:
    """A result as if it had been loaded, of no logs."""
    columns = (0, (), 1.0, ()) if base is None else (base.rank, base.names, 1.0, base.expressions)
    facts = FitFacts((), (), 0, *columns, {}, 0.0123, 0.0123, (), None)
    return Identification(robot, task, recipe, estimate, 1.0, kept=facts, folder=folder)


def with_estimate(result: Identification, **changes: Any) -> Identification:
    """A result with another estimate."""
    return replace(result, estimate=replace(result.estimate, **changes))


def predicted(result: Identification, samples: Samples) -> tuple[Array, Array]:
    """Torques of the identified model, of bodies and rotors, and of friction, shapes (N, n)."""
    target = instantaneous_target(result.robot, result.task, result.recipe)
    W = target.model.instants(samples)[:, target.base.index]
    friction = np.array([target.base.columns[k].group == "friction" for k in target.base.index])
    shape = (samples.time.size, -1)
    parts = (W[:, chosen] @ result.coefficients[chosen] for chosen in (~friction, friction))
    rigid, of_friction = (part.reshape(shape) for part in parts)
    return rigid, of_friction


def relative(found: Array, expected: Array) -> float:
    """Largest difference over the largest torque."""
    return float(np.abs(found - expected).max() / np.abs(expected).max())


FREEDOM = 8
FRICTION = 0.4  # that the result has [Nm, Nm s/rad]


def compact_arm() -> Robot:
    """The UR10e with links that are boxes of 3 kg."""
    theta = from_centre_of_mass(3.0, [0.1, 0.02, 0.05], np.diag([0.04, 0.05, 0.06]))
    robot = excite.load_robot("ur10e")
    return robot.replace(links=tuple(Link(link.name, theta, link.number) for link in robot.links))


def two_links(folder: Path, share: float = 0.15) -> Identification:
    """Its axes 2 and 3: deviations of a share of each parameter, Coulomb friction that is a tenth of its deviation."""
    (folder / "result.json").write_text("{}")
    robot, few = compact_arm(), {"joints": ("2", "3")}
    target = torque_target(result_of(robot, folder, **few))
    described = dict.fromkeys((c.name for c in target.model.standard_columns), FRICTION)
    result = result_of(robot, folder, {**described, **standard_values(target.robot)}, **few)
    beta = result.coefficients
    size = np.maximum(np.abs(beta), 0.02 * np.abs(beta).max())
    Q = np.linalg.qr(np.random.default_rng(0).normal(size=(beta.size, beta.size)))[0]
    covariance = share**2 * np.outer(size, size) * (Q @ np.diag(np.linspace(0.2, 1.8, beta.size)) @ Q.T)
    coulomb = [name.startswith("F") and name.endswith("c") for name in result.names]
    fit = np.where(coulomb, 0.1 * np.sqrt(np.diag(covariance)), beta)
    return with_estimate(result, fit=fit, covariance=covariance, degrees_of_freedom=FREEDOM)
