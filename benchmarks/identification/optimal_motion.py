"""Study 1: what an optimal motion is worth, as in Fig. 15 of Kozlowski and Dutkiewicz (1996), on the IRp-6.

The designed motion against the paper's quintic motion, random moves from point to point, and random Fourier series, all
of 10 s and within the same limits: predicted deviations of the 13 parameters, and those of identifications from
simulated measurements. And the figure itself: joint 1 alone, short integrals, estimates over time.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import record
from moves import Moves, random_moves, shortest
from remeasured import remeasured
from threadpoolctl import threadpool_limits

from excite.design.formulation import Formulation, formulate
from excite.design.initial_guesses import random_motion
from excite.design.optimisation import design_trajectory, limits_of
from excite.identification.estimator import Estimate
from excite.identification.estimators.least_squares import recursive, weighted
from excite.identification.identification import Identification
from excite.identification.procedure import estimate_parameters
from excite.identification.recipe import Recipe
from excite.simulation.settings import SimulationSettings
from excite.simulation.simulate import simulate_motion
from excite.tasks.reference import Reference
from excite.tasks.task import Task
from excite.trajectories import Trajectory
from excite.views.style import BLUE, DARK, DPI, LABEL, NOTE, ORANGE, VERMILLION, drawing_style, figure_of
from regressors.models.nominal import parameter_values, standard_values
from regressors.readers.library import load_robot
from regressors.samples import Array

HERE = Path(__file__).resolve().parent
RANDOM, MEASUREMENTS, SEED = 200, 50, 0
RATE, TORQUE_NOISE, COUNTS = 2000.0, 1.0, 4000.0  # Hz, Nm, per revolution of the motor
CRITERIA = ("condition", "trace", "logdet")
POSES = np.deg2rad([[-40.0, 10.0, -30.0], [30.0, -20.0, 40.0]])  # joints 1-3 of the paper's quintic motion
ROBOT, TASK = load_robot("irp6"), Task("irp6", noise=(TORQUE_NOISE,))
SLOW = 0.05  # rad/s, of the fastest joint
SETTINGS = SimulationSettings(rate=RATE, encoder=(COUNTS,), torque_noise=(TORQUE_NOISE,))
COLOURS = {"designed": BLUE, "random series, median": ORANGE, "paper's quintic": VERMILLION}


@dataclass(frozen=True, eq=False)
class Judged:
    """A motion and what it would leave uncertain: condition number and deviations of the parameters."""

    name: str
    motion: Reference
    condition_number: float
    deviation: Array

    def relative(self, beta: Array) -> Array:
        return self.deviation / np.abs(beta)


def judged(name: str, motion: Reference, made: Formulation) -> Judged:
    """A motion by its exact regressor at the log's rate: ``sqrt(diag((W' W)^-1))`` times the noise of the torques."""
    samples = motion.samples(np.arange(round(motion.duration * RATE) + 1) / RATE)
    W = made.target.model.assemble(samples)[:, made.target.base.index]
    R = np.linalg.qr(W, mode="r")
    sigma = np.linalg.svd(R, compute_uv=False)
    deviation = TORQUE_NOISE * np.linalg.norm(np.linalg.inv(R), axis=1)
    return Judged(name, motion, float(sigma[0] / sigma[-1]), deviation)


def random_series(made: Formulation, number: int) -> Trajectory:
    """A random Fourier series of the design's family, as large as its limits allow, certified."""
    problem = made.problem
    x = random_motion(problem, np.random.default_rng([SEED, number]))
    x = x + problem.longest_step(x, x - problem.rest) * (x - problem.rest)
    motion = problem.information.trajectory(x)
    if not all(use.holds for use in limits_of(made, motion)):
        raise RuntimeError(f"random motion {number} exceeds a limit")
    return motion


def quintic(made: Formulation, ends: Array = POSES) -> Moves:
    """A way to and fro, as fast as the limits allow."""
    poses = ends[np.arange(2 * round(TASK.trajectory.period)) % 2]
    return Moves(poses, shortest(poses, made.limits), TASK.trajectory.period)


def simulated(one: Judged, beta: Array) -> tuple[dict[str, Any], Identification]:
    """Identifications from measurements of one simulated run; the first of them too."""
    run = simulate_motion(ROBOT, TASK, one.motion, SETTINGS)
    results = []
    for number in range(MEASUREMENTS):
        log = remeasured(run, COUNTS, TORQUE_NOISE, number)
        results.append(estimate_parameters(ROBOT, TASK, [log], Recipe()))
    estimates = [result.estimate for result in results]
    error = np.array([estimate.coefficients for estimate in estimates]) - beta
    found = {
        "rms_error": np.sqrt(np.mean(error**2, axis=0)).tolist(),
        "mean_error": error.mean(axis=0).tolist(),
        "stated_deviation": np.mean([estimate.deviation for estimate in estimates], axis=0).tolist(),
        "inside_99": inside(estimates, beta),
        "inside_99_without_slow_rows": inside([without_slow_rows(result) for result in results], beta),
        "unseen": sorted({name for estimate in estimates for name in estimate.unseen}),
        "condition_number": results[0].condition_number,
        "recipe": results[0].recipe.to_dict(),
        "notes": list(results[0].prepared[0].notes),
    }
    return found, results[0]


def inside(estimates: list[Estimate], beta: Array) -> float:
    """Part of the true parameters that lie in their 99 % intervals."""
    return float(np.mean([np.abs(one.coefficients - beta) <= one.half_width for one in estimates]))


def without_slow_rows(result: Identification) -> Estimate:
    """Estimate from the instants at which some joint moves fast enough for friction's direction to be beyond doubt."""
    samples = result.prepared[0].samples
    fast = np.abs(samples.dq).max(axis=1) > SLOW
    return weighted(result.observations.rows(np.flatnonzero(np.repeat(fast, samples.q.shape[1]))))


def joint_1() -> dict[str, Identification]:
    """The experiment of the paper: joint 1 alone, three parameters by short integrals; optimal and quintic motion."""
    task = Task("irp6", model="energy", joints=("1",), noise=(TORQUE_NOISE,))
    poses = POSES * [1.0, 0.0, 0.0]
    motions: dict[str, Reference] = {
        "designed": design_trajectory(task.changed(robot=ROBOT)).trajectory,
        "paper's quintic": quintic(formulate(ROBOT, TASK), poses),
    }
    found = {}
    for label, motion in motions.items():
        run = simulate_motion(ROBOT, task, motion, SETTINGS)
        log = remeasured(run, COUNTS, TORQUE_NOISE, SEED)
        found[label] = estimate_parameters(ROBOT, task, [log], Recipe())
    return found


Column = tuple[str, dict[str, Identification], tuple[str, ...]]


@drawing_style("screen")
def figure(columns: list[Column], beta: dict[str, float], path: Path) -> None:
    """Recursive estimates over time: a column per experiment, a panel per parameter, a line per motion."""
    drawing = figure_of(11.0, 7.5, "Recursive estimates: optimal motion and others")
    panels = drawing.subplots(max(len(names) for _, _, names in columns), len(columns), sharex=True, squeeze=False)
    for column, (title, results, names) in zip(panels.T, columns, strict=True):
        column[0].set_title(title, loc="left", fontsize=LABEL, color=DARK)
        column[-1].set_xlabel("time [s]", fontsize=LABEL, color=DARK)
        paths = {label: recursive(result.observations, every=20).history for label, result in results.items()}
        for ax, name in zip(column, names, strict=True):
            spread = 0.0
            for label, result in results.items():
                k = result.estimate.names.index(name)
                time, values = paths[label] or (np.zeros(0), np.zeros((0, k + 1)))
                ax.plot(time, values[:, k], color=COLOURS[label], linewidth=1.2, label=label)
                spread = max(spread, 10 * float(result.estimate.deviation[k]), 0.02 * abs(beta[name]))
            ax.axhline(beta[name], color=DARK, linewidth=0.8, linestyle="--", label="true")
            ax.set_ylim(beta[name] - spread, beta[name] + spread)
            ax.set_ylabel(f"{name} [{result.estimate.units[k]}]", fontsize=LABEL, color=DARK)
        column[0].legend(loc="upper right", fontsize=NOTE)
    path.parent.mkdir(exist_ok=True)
    drawing.savefig(path, dpi=DPI)


def ordered(motions: list[Judged], beta: Array) -> list[Judged]:
    """Motions from the lowest to the highest largest relative deviation."""
    return sorted(motions, key=lambda one: float(one.relative(beta).max()))


def line(one: Judged, best: Judged, beta: Array, names: tuple[str, ...]) -> list[object]:
    """One line of the first table."""
    relative = one.relative(beta)
    worst = int(np.argmax(relative))
    mean = float(np.exp(np.mean(np.log(one.deviation / best.deviation))))
    return [
        one.name,
        f"{one.condition_number:.4g}",
        f"{100 * relative[worst]:.3g} % ({names[worst]})",
        f"{relative[worst] / best.relative(beta).max():.3g}",
        f"{mean:.3g}",
    ]


HEAD = ("motion", "cond(W)", "largest relative deviation", "of the design's", "all deviations, geometric mean")

LIMITATIONS = (
    f"IRp-6, joints 1-3, {TASK.trajectory.period:g} s at {RATE:g} Hz, white noise of {TORQUE_NOISE:g} Nm on every "
    f"torque, encoders of {COUNTS:g} counts on the motors; true parameters are those of the robot's file, partly "
    "assumed",
    "predicted: from the exact regressor of the wanted motion; simulated: root mean square error of "
    f"{MEASUREMENTS} identifications by the defaults of `excite identify`, from one simulated run (computed torque, "
    "friction that turns within 0.1 % of the largest velocity) measured with other noise and other positions of the "
    "encoders' steps",
    f"random: {RANDOM} Fourier series of the design's harmonics with normal coefficients, each scaled until it touches "
    f"a limit and certified; {RANDOM} sequences of quintic moves between uniform random poses, each as fast as the "
    "limits allow; median and best by the largest relative deviation",
    "paper's motion: joints 1-3 of its load trajectory, a straight way to and fro; 1.8327 s a move instead of its "
    "1.83 s, which exceeds an acceleration limit by 0.3 %; cut at 10 s",
    "white noise makes all deviations proportional to its size; offsets, drift and errors of the model do not shrink "
    "like this",
)


@threadpool_limits.wrap(limits=1)
def main() -> None:
    """Designs, the other motions, simulations, figure."""
    before = record.load()
    made = formulate(ROBOT, TASK)
    names = made.target.base.names
    beta = parameter_values(made.target.model, made.target.base, standard_values(made.target.robot))
    designs = []
    for criterion in CRITERIA:
        design = design_trajectory(Task("irp6", criterion=criterion, noise=(TORQUE_NOISE,)).changed(robot=ROBOT))
        title = "designed (default)" if criterion == "condition" else f"designed, criterion {criterion}"
        designs.append(judged(title, design.trajectory, made))
    best = designs[0]
    series = [judged(f"random series {k}", random_series(made, k), made) for k in range(RANDOM)]
    rngs = (np.random.default_rng([SEED, 1, k]) for k in range(RANDOM))
    moves = [judged("random moves", random_moves(made.limits, TASK.trajectory.period, rng), made) for rng in rngs]
    paper = judged("paper's quintic, to and fro", quintic(made), made)
    groups = {"random series": ordered(series, beta), "random moves": ordered(moves, beta)}
    picked = {kind: {"best": group[0], "median": group[RANDOM // 2]} for kind, group in groups.items()}
    rows = [line(one, best, beta, names) for one in designs]
    for kind, found in picked.items():
        for which, one in found.items():
            rows.append([f"{kind}, {which}", *line(one, best, beta, names)[1:]])
    rows.append(line(paper, best, beta, names))
    motions = {
        "designed": best, "random series, median": picked["random series"]["median"], "paper's quintic": paper,
    }  # fmt: skip
    checked = {label: simulated(one, beta) for label, one in motions.items()}
    alone = joint_1()
    together = {label: result for label, (_, result) in checked.items()}
    columns: list[Column] = [
        ("joint 1 alone, short integrals (as Fig. 15)", alone, ("X1", "F1c", "F1v")),
        ("joints 1-3, differential model", together, ("X2", "F1c", "F1v")),
    ]
    figure(columns, dict(zip(names, beta.tolist(), strict=True)), HERE / "results" / "optimal_motion.png")
    beaten = {
        kind: sum(one.condition_number > best.condition_number for one in group) for kind, group in groups.items()
    }
    text = "\n\n".join(
        [
            record.table(HEAD, rows),
            "The design's cond(W) is lower than that of "
            + " and of ".join(f"{count} of {RANDOM} {kind}" for kind, count in beaten.items())
            + ".",
            parameter_table(motions, {label: found for label, (found, _) in checked.items()}, names, beta),
            "Joint 1 alone, short integrals: stated deviations in percent, and errors of one measurement over them.",
            record.table(
                ("motion", "cond(W)", "X1", "F1c", "F1v"), [alone_row(*one, names, beta) for one in alone.items()]
            ),
            "![Recursive estimates](results/optimal_motion.png)",
        ]
    )
    content = {
        "names": list(names),
        "true": beta.tolist(),
        "motions": {one.name: plain(one) for one in (*designs, paper)},
        "random": {
            kind: [[one.condition_number, float(one.relative(beta).max())] for one in group]
            for kind, group in groups.items()
        },
        "beaten": beaten,
        "simulated": {label: {"predicted": plain(motions[label]), **found} for label, (found, _) in checked.items()},
    }
    record.save("optimal_motion", before, content, text, LIMITATIONS, folder=HERE)


def alone_row(label: str, result: Identification, names: tuple[str, ...], beta: Array) -> list[object]:
    """One line of the table of joint 1."""
    estimate, cells = result.estimate, []
    for name in ("X1", "F1c", "F1v"):
        k, true = estimate.names.index(name), beta[names.index(name)]
        deviation = float(estimate.deviation[k])
        cells.append(f"{100 * deviation / abs(true):.3g} %, {(estimate.values[k] - true) / deviation:.1f}")
    return [label, f"{result.condition_number:.4g}", *cells]


def plain(one: Judged) -> dict[str, Any]:
    """A judged motion for JSON."""
    return {"condition_number": one.condition_number, "deviation": one.deviation.tolist()}


def parameter_table(
    motions: dict[str, Judged], found: dict[str, dict[str, Any]], names: tuple[str, ...], beta: Array
) -> str:
    """Predicted and simulated deviations of every parameter, in percent of its magnitude."""
    head = ["parameter", "true", *(f"{label}: predicted %, rms error %, stated %" for label in motions)]
    rows = []
    for k, name in enumerate(names):
        cells = []
        for label, one in motions.items():
            values = (one.deviation[k], found[label]["rms_error"][k], found[label]["stated_deviation"][k])
            cells.append(", ".join(f"{100 * value / abs(beta[k]):.3g}" for value in values))
        rows.append([name, f"{beta[k]:.4g}", *cells])
    title = f"the same without instants below {SLOW:g} rad/s"
    rows.append(["in 99 % intervals", "", *(f"{100 * found[label]['inside_99']:.1f} %" for label in motions)])
    rows.append([title, "", *(f"{100 * found[label]['inside_99_without_slow_rows']:.1f} %" for label in motions)])
    return record.table(head, rows)


if __name__ == "__main__":
    main()
