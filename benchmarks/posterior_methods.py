"""Which method draws possible robots with the least work: independent draws per second of processor time.

``python benchmarks/posterior_methods.py`` identifies the IRp-6 and a Panda once each with autoregressive noise, and
draws from their posteriors by elliptical slice sampling [Murray, Adams, MacKay 2010], hit-and-run [Smith 1984] and
Hamiltonian paths with reflections, with and without the learned shape. Seeds are fixed.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import numpy as np
import posterior
import record
import scipy.stats

from excite.identification.estimators.possible_set import PossibleSet
from excite.identification.identification import torque_target
from excite.study import chains as chains, chains as reflected_paths
from excite.study.chains import PosteriorCoordinates, coordinates_inside, inner_point
from excite.study.sample_posterior import PRIOR, effective_draws, posterior_of, split_deviation
from regressors.samples import Array

CHAINS, SEED = 32, 0
CASES = (posterior.Case("irp6", "autoregressive"), posterior.Case("panda", "autoregressive"))
Step = Callable[[Array, np.random.Generator], Array]


@dataclass
class Problem:
    """A posterior, its bounds and a point inside."""

    coordinates: PosteriorCoordinates
    possible: PossibleSet
    start: Array


def problem(case: posterior.Case) -> Problem:
    """The posterior of one identified log."""
    rng, experiment = np.random.default_rng([SEED, 0]), case.experiment
    result = posterior.identified(case, experiment, experiment.log(experiment.truth(rng), case.noise, rng, 0))
    standard, coordinates = posterior_of(result, torque_target(result), PRIOR)
    possible = coordinates_inside(standard, coordinates)
    return Problem(coordinates, possible, inner_point(possible)[0])


def elliptical(p: Problem) -> Step:
    """A point of an ellipse through the current one and a draw without bounds; normal posteriors alone."""

    def step(z: Array, rng: np.random.Generator) -> Array:
        v, new, active = rng.normal(size=z.shape), z.copy(), np.arange(len(z))
        t = rng.uniform(0, 2 * np.pi, len(z))
        low, high = t - 2 * np.pi, t.copy()
        while active.size:
            other = z[active] * np.cos(t[active])[:, None] + v[active] * np.sin(t[active])[:, None]
            inside = p.possible.contains(other)
            new[active[inside]] = other[inside]
            active = active[~inside]
            behind = t[active] < 0
            low[active[behind]], high[active[~behind]] = t[active[behind]], t[active[~behind]]
            t[active] = rng.uniform(low[active], high[active])
        return new

    return step


def hit_and_run(p: Problem) -> Step:
    """A point of the chord through the current one in a random direction; normal posteriors alone."""

    def step(z: Array, rng: np.random.Generator) -> Array:
        u = rng.normal(size=z.shape)
        u /= np.linalg.norm(u, axis=1)[:, None]
        inverse = np.linalg.inv(np.linalg.cholesky(p.possible.M + p.possible.bodies(z)))
        values = np.linalg.eigvalsh(inverse @ p.possible.bodies(u) @ inverse.swapaxes(-1, -2))
        rates = u @ p.possible.b.T / (p.possible.c + z @ p.possible.b.T)
        high = -1 / np.concatenate([values[..., 0], rates], axis=1).min(axis=1)
        low = -1 / np.concatenate([values[..., -1], rates], axis=1).max(axis=1)
        middle = -np.sum(z * u, axis=1)
        s = scipy.stats.truncnorm.rvs(low - middle, high - middle, loc=middle, random_state=rng)
        return np.asarray(z + np.clip(s, low * (1 - 1e-9), high * (1 - 1e-9))[:, None] * u)

    return step


def paths(p: Problem) -> Step:
    """Paths with reflections in the posterior's own coordinates."""
    shape, length = np.eye(p.coordinates.size), reflected_paths.STEP

    def step(z: Array, rng: np.random.Generator) -> Array:
        return reflected_paths.next_points(p.coordinates, p.possible, z, rng, shape, length)[0]

    return step


def measured(p: Problem, step: Step, rounds: int) -> tuple[float, float]:
    """Independent draws per second, of the least known parameter, and R; the first quarter is warm-up, and counts."""
    rng, z, kept = np.random.default_rng(SEED), np.tile(p.start, (CHAINS, 1)), []
    began = time.process_time()
    for k in range(rounds):
        z = step(z, rng)
        if k >= rounds // 4:
            kept.append(p.coordinates.theta(z))
    return _mixed(np.array(kept), time.process_time() - began)


def learned(p: Problem, rounds: int) -> tuple[float, float]:
    """The same of what `sample_posterior` does."""
    began = time.process_time()
    z = chains.draws(p.coordinates, p.possible, p.start, CHAINS * rounds, SEED)
    return _mixed(p.coordinates.theta(z), time.process_time() - began)


def _mixed(theta: Array, seconds: float) -> tuple[float, float]:
    theta = theta[..., np.ptp(theta, axis=(0, 1)) > 0]
    return float(effective_draws(theta).min() / seconds), float(split_deviation(theta).max())


def main() -> None:
    """Measure, and write the table."""
    load, rows, found = record.load(), [], []
    for case in CASES:
        p = problem(case)
        z = np.random.default_rng(SEED).normal(size=(20_000, p.coordinates.size))
        share = float(p.possible.contains(z).mean())
        rates = {
            "elliptical slice sampling": measured(p, elliptical(p), 500),
            "hit-and-run": measured(p, hit_and_run(p), 500),
            "paths with reflections": measured(p, paths(p), 60),
            "the same, shape learned": learned(p, 40),
        }
        found.append({"robot": case.robot, "size": p.coordinates.size, "accepted": share, "methods": rates})
        for name, (rate, spread) in rates.items():
            known = case.robot, p.coordinates.size, f"{100 * share:.3g} %"
            rows.append([*known, name, f"**{rate:.1f}**", f"{spread:.3f}"])
    head = ["robot", "coordinates", "possible without bounds", "method", "independent draws per CPU s", "R"]
    record.save("posterior_methods", load, {"seed": SEED, "cases": found}, record.table(head, rows), LIMITATIONS)


LIMITATIONS = (
    "One posterior per robot, 32 chains from one point, code in NumPy; warm-up counts. Where R is above 1.05 the "
    "chains have not mixed, and their rate is an upper bound.",
    "Elliptical slice sampling and hit-and-run draw from the normal posterior, the others from Student's t.",
)

if __name__ == "__main__":
    main()
