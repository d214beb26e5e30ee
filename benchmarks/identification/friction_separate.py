"""Friction measured on its own and subtracted, against friction identified along with the mass parameters.

The argument of Kozlowski and Dutkiewicz (1996), section 5.2 and Fig. 5, tried on a simulated IRp-6 with Tustin friction
whose stiction is the paper's: joints that move one by one on splined polynomials of fifth order, and an optimal motion
of all three; differential and energy model; the same friction in both experiments, friction that has changed in
between, and friction that really is Coulomb and viscous.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import record
from friction_separate_figure import figure
from friction_separate_text import text
from friction_truth import ROBOT, TRUTH
from moves import Moves, shortest
from remeasured import remeasured
from threadpoolctl import threadpool_limits

from excite.design.formulation import formulate
from excite.design.friction_runs.friction_plan import CoordinatePlan
from excite.design.friction_runs.plan_friction import plan_friction
from excite.design.friction_runs.schedule import Schedule
from excite.design.optimisation import design_trajectory
from excite.friction.constant_speed_windows import ConstantWindow
from excite.friction.curve_fit import CurveFit, chosen_fit, curve_uncertainty
from excite.friction.friction_equations import forms
from excite.friction.points import described_model, drive_log, points_of
from excite.identification.estimators.least_squares import recursive
from excite.identification.procedure import estimate_parameters
from excite.identification.recipe import Recipe
from excite.information.target import target_of
from excite.logs.log import Log
from excite.simulation.settings import SimulationSettings
from excite.simulation.simulate import simulate_motion
from excite.simulation.simulation import Simulation
from excite.tasks.reference import Reference, SampledMotion
from excite.tasks.task import Task
from excite.views.style import DPI
from regressors.models.nominal import parameter_values
from regressors.robot.friction.curve import CoulombViscous, FrictionCurve
from regressors.robot.friction.curves import FrictionCurves
from regressors.samples import Array, Samples

HERE = Path(__file__).resolve().parent
REPETITIONS, FEWER = 50, 12  # of the first case, and of the others and of what is beside the point
RATE, RUNS_RATE = 2000.0, 1000.0  # exciting motions, friction runs [Hz]
TORQUE_NOISE, COUNTS = 1.0, 4000.0  # Nm, per revolution of the motors
LONGEST, SHORTEST, MARGIN = 0.5, 0.2, 0.02  # windows of constant speed, and what is left out at both ends [s]
TASK = Task("irp6", noise=(TORQUE_NOISE,))
DRIVES = tuple(TRUTH)
#: Ends of the polynomials of the drive that moves [deg].
POSES = {"z1": (-40.0, 30.0, -10.0, 10.0), "z2": (-35.0, 30.0, -10.0, 10.0), "z3": (-28.0, 28.0, -10.0, 10.0)}
WEIGHED_DOWN = ("z3",)  # drives whose runs bear gravity that does not cancel
DESIGNED = "designed"
GRID = np.linspace(0.0, 10.0, 1001)  # of the figure [s]
TUSTIN: dict[str, FrictionCurve] = dict(TRUTH)
EQUATION_1: dict[str, FrictionCurve] = {
    "z1": CoulombViscous(9.0, 25.0),
    "z2": CoulombViscous(9.0, 26.0),
    "z3": CoulombViscous(10.7, 26.0),
}


@dataclass(frozen=True)
class Case:
    """Friction of the drives in the runs; its factor in the exciting motion, and whether it sticks there."""

    name: str
    friction: dict[str, FrictionCurve]
    factor: float = 1.0
    sticks: bool = True

    @property
    def then(self) -> FrictionCurves:
        return FrictionCurves(self.friction).scaled(dict.fromkeys(self.friction, self.factor))


@dataclass(frozen=True)
class Model:
    """Which equations are identified from."""

    name: str
    changes: dict[str, str]

    def of(self, task: Task) -> Task:
        return task.changed(**self.changes)  # type: ignore[arg-type]


@dataclass(frozen=True)
class Way:
    """What is done about friction."""

    name: str
    known: bool = False
    offset: bool = False


CASES = (
    Case("Tustin's", TUSTIN),
    Case("Tustin's, 10 % lower later", TUSTIN, 0.9),
    Case("Coulomb and viscous", EQUATION_1),
    Case("Tustin's, never sticking", TUSTIN, sticks=False),
)
DIFFERENTIAL, ENERGY = Model("differential", {"model": "differential"}), Model("energy, 5 ms", {"model": "energy"})
LONG = Model("energy, long windows", {"model": "energy", "window": "long"})
WAYS = (Way("separate", known=True), Way("all at once"), Way("all at once, with offsets", offset=True))


@threadpool_limits.wrap(limits=1)
def main() -> None:
    """All cases, and the results."""
    before, cpu = record.load(), time.process_time()
    schedule = Schedule(rate=RUNS_RATE, shortest=SHORTEST, longest=LONGEST, warm_up=0.0, breakaways=0)
    plans = plan_friction(ROBOT, schedule, drives=DRIVES).coordinates
    motions = exciting_motions()
    tustin, linear = Measured(TUSTIN, plans, REPETITIONS), Measured(EQUATION_1, plans, FEWER)
    studies = [
        Studied(case, measured, motions) for case, measured in zip(CASES, (tustin, tustin, linear, tustin), strict=True)
    ]
    cases = [study.found() for study in studies]
    drawn, true = studies[0].drawn, float(studies[0].described["z1"][2][0])
    content = {
        "repetitions": [REPETITIONS, FEWER],
        "friction_runs_s": [float(plan.samples()[0].time[-1]) for plan in plans],
        "windows": [len(plan.windows) for plan in plans],
        "motions_s": {name: float(motion.duration) for name, (_, motion) in motions.items()},
        "settling_s": [[*key, settling(paths, true)] for key, paths in drawn.items() if key[0] == "z1"],
        "cases": cases,
        "cpu_seconds": time.process_time() - cpu,
    }
    (HERE / "results").mkdir(exist_ok=True)
    figure(GRID, drawn, true).savefig(HERE / "results" / "friction_separate.png", dpi=DPI)
    record.save("friction_separate", before, content, text(content), LIMITATIONS, folder=HERE)


def settling(paths: list[Array], true: float) -> float:
    """Time from which on an estimate stays within 2 % of the truth, median of the repetitions [s]."""
    outside = [np.abs(path - true) > 0.02 * true for path in paths]
    return float(np.median([GRID[np.flatnonzero(one)[-1] + 1] if one.any() else 0.0 for one in outside]))


# --- motions ---------------------------------------------------------------------------------------------------------


def exciting_motions() -> dict[str, tuple[Task, Reference]]:
    """Each drive alone on splined polynomials of fifth order, as fast as the limits allow; the designed motion."""
    limits = formulate(ROBOT, TASK).limits
    found: dict[str, tuple[Task, Reference]] = {}
    for drive, degrees in POSES.items():
        task = TASK.changed(drives=(drive,))
        motion = target_of(ROBOT, task, 0.0).motion
        poses = motion.offset + np.outer(np.deg2rad(degrees), motion.matrix[:, 0])
        lengths = shortest(poses, limits)
        found[drive] = (task, Moves(poses, lengths, float(lengths.sum())))
    found[DESIGNED] = (TASK, design_trajectory(TASK.changed(robot=ROBOT)).trajectory)
    return found


# --- friction on its own ---------------------------------------------------------------------------------------------


class Measured:
    """Curves of all drives from friction runs that are simulated once and measured many times.

    Parameters
    ----------
    friction : dict of str to FrictionCurve
        The truth.
    plans : tuple of CoordinatePlan
        One per drive.
    count : int
        Of the measurements.
    """

    def __init__(self, friction: dict[str, FrictionCurve], plans: tuple[CoordinatePlan, ...], count: int) -> None:
        self.chosen: dict[str, dict[str, int]] = {plan.label: {} for plan in plans}
        self.rms_error: dict[str, float] = {}
        fits: list[dict[str, CurveFit]] = [{} for _ in range(count)]
        for plan in plans:
            drive, errors = plan.label, []
            run = friction_run(plan, friction)
            speeds = max(w.speed for w in plan.windows) * np.concatenate([-SPEEDS, SPEEDS])
            for seed in range(count):
                log = remeasured(run, COUNTS, TORQUE_NOISE, REPETITIONS + seed)
                fit = fits[seed][drive] = fitted_curve(plan, log)
                form = fit.form.name
                self.chosen[drive][form] = self.chosen[drive].get(form, 0) + 1
                errors.append(fit.curve.torque(speeds) - friction[drive].torque(speeds))
            self.rms_error[drive] = float(np.sqrt(np.mean(np.square(errors))))
        self.curves = [
            FrictionCurves(
                {drive: fit.curve for drive, fit in found.items()},
                {drive: curve_uncertainty(fit) for drive, fit in found.items()},
            )
            for found in fits
        ]


def friction_run(plan: CoordinatePlan, friction: dict[str, FrictionCurve]) -> Simulation:
    """The runs of one drive."""
    samples, _ = plan.samples()
    q, dq, ddq = (np.ascontiguousarray(x[:, : len(DRIVES)]) for x in (samples.q, samples.dq, samples.ddq))
    reference = SampledMotion(Samples(samples.time, q, dq, ddq, np.full_like(q, np.nan)))
    settings = SimulationSettings(rate=RUNS_RATE, torque_limits=False, breakaway="auto")
    return simulate_motion(ROBOT, TASK, reference, settings, friction=FrictionCurves(friction))


def fitted_curve(plan: CoordinatePlan, log: Log) -> CurveFit:
    """Curve of one drive by [KD96] eq. (20) over the whole windows, of the form that BIC chooses."""
    motion, drive = drive_log(log, ROBOT), plan.label
    z = motion.z[:, motion.names.index(drive)]
    windows = []
    for one in plan.windows:
        a, b = (round(t * RUNS_RATE) for t in (one.start + MARGIN, one.end - MARGIN))
        windows.append(ConstantWindow(a, b + 1, float((z[b] - z[a]) / (log.time[b] - log.time[a]))))
    rigid = described_model(motion.robot) if drive in WEIGHED_DOWN else None
    points = points_of(motion, drive, windows, rigid)
    best, _, _ = chosen_fit(points, forms("auto", None, offset=True, temperature=None), "bic")
    return best


# --- identification --------------------------------------------------------------------------------------------------


class Studied:
    """Repetitions of one case: everything is simulated once and measured many times."""

    def __init__(self, case: Case, measured: Measured, motions: dict[str, tuple[Task, Reference]]) -> None:
        self.case, self.measured, self.motions = case, measured, motions
        self.whole = case is CASES[0]  # long windows and offsets too, and the figure
        self.drawn: dict[tuple[str, str, str], list[Array]] = {}
        self.estimates: dict[tuple[str, str, str], list[tuple[Array, Array]]] = {}
        self.described: dict[str, tuple[list[str], list[str], Array]] = {}

    def found(self) -> dict[str, Any]:
        """Errors of every way."""
        settings = SimulationSettings(rate=RATE, breakaway="auto" if self.case.sticks else None)
        plain = [(model, way) for model in (DIFFERENTIAL, ENERGY) for way in WAYS[:2]]
        more = [(LONG, way) for way in WAYS[:2]] + [(model, WAYS[2]) for model in (DIFFERENTIAL, ENERGY)]
        for name, (task, motion) in self.motions.items():
            run = simulate_motion(ROBOT, task, motion, settings, friction=self.case.then)
            for seed in range(REPETITIONS if self.whole else FEWER):
                log = remeasured(run, COUNTS, TORQUE_NOISE, seed)
                for model, way in plain + (more if self.whole and seed < FEWER else []):
                    self._identify(name, run, log, model, way, seed)
        return {
            "case": self.case.name,
            "chosen_curves": self.measured.chosen,
            "rms_curve_error": self.measured.rms_error,
            "ways": list(self._ways()),
        }

    def _identify(self, name: str, run: Simulation, log: Log, model: Model, way: Way, seed: int) -> None:
        task = model.of(self.motions[name][0]).changed(offset=way.offset)
        known = self.measured.curves[seed] if way.known else None
        result = estimate_parameters(ROBOT, task, [log], Recipe(), friction=known)
        estimate, target = result.estimate, result.target
        mass = [k for k, x in enumerate(estimate.names) if not x.startswith("F")]
        if name not in self.described:
            beta = parameter_values(target.model, target.base, dict(run.truth))
            names, units = ([x[k] for k in mass] for x in (estimate.names, estimate.units))
            self.described[name] = (names, units, beta[mass])
        key = (name, model.name, way.name)
        self.estimates.setdefault(key, []).append((estimate.coefficients[mass], estimate.half_width[mass]))
        if self.whole and name in ("z1", DESIGNED) and model is not LONG and not way.offset and seed < FEWER:
            history = recursive(result.observations, every=4).history
            assert history is not None
            column = history[1][:, estimate.names.index("X1")]
            path = np.interp(GRID, history[0], column, left=np.nan, right=np.nan)
            self.drawn.setdefault(key, []).append(path)

    def _ways(self) -> Iterator[dict[str, Any]]:
        for (name, model, way), found in self.estimates.items():
            names, units, beta = self.described[name]
            error = np.array([x for x, _ in found]) - beta
            half = np.array([half for _, half in found])
            yield {
                "motion": name,
                "repetitions": len(found),
                "model": model,
                "friction": way,
                "names": names,
                "units": units,
                "true": beta.tolist(),
                "bias": error.mean(axis=0).tolist(),
                "deviation": error.std(axis=0, ddof=1).tolist(),
                "rms_error": np.sqrt(np.mean(error**2, axis=0)).tolist(),
                "half_width": np.median(half, axis=0).tolist(),
                "within_99": np.mean(np.abs(error) <= half, axis=0).tolist(),
            }


SPEEDS = np.linspace(0.02, 1.0, 50)

LIMITATIONS = (
    "simulated: beside friction's shape, noise and counts nothing is wrong with the models; friction does not depend "
    "on position, load or temperature, but for the case in which all of it changes by the same factor",
    "the paper prints stiction only; Coulomb friction below it, viscous friction and the Stribeck speed are assumed, "
    "as in friction_truth",
    "the friction runs of the third drive bear gravity that does not cancel; it is taken off with the true value, as "
    "if the link were balanced as in the paper; for the other drives no model is used",
    f"white noise of {TORQUE_NOISE:g} Nm on every torque, encoders of {COUNTS:g} counts on the motors, {RATE:g} Hz; "
    "every run is simulated once (computed torque) and measured again with other noise and other steps of the encoders",
    "identification by the defaults of `excite identify`; intervals allow for the uncertainty of the curves' fits, not "
    "for friction that has changed since",
    "simulated friction sticks at rest and turns over 1e-5 rad, except in the last case; low-passed positions do not "
    "show the jerk after it, which biases the differential model in all ways alike",
    "'all at once' does not use the friction runs, which last several times as long as the exciting motions",
)


if __name__ == "__main__":
    main()
