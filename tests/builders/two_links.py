"""A result of two moving links whose posterior reaches beyond what is possible."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from identified import result_of, with_estimate

import excite
from excite.identification.identification import Identification
from excite.identification.torque_target import torque_target
from regressors.models.nominal import standard_values
from regressors.robot.inertia import from_centre_of_mass
from regressors.robot.robot import Link, Robot

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
