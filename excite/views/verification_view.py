"""What is shown of a verification, and of a simulated log: torques, the motion and its errors, the energy balance."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import PurePath

from excite.simulation.simulation import SimulatedLog, Simulation
from excite.verification.verification import Verification
from excite.views.view import Drawing, View, ViewTable, headed
from regressors.errors import listed_names, percent

_DRAWN = (
    Drawing("Predicted and measured", "torques", "verification_plots.predicted_torques_figure"),
    Drawing("Simulated and measured motion", "motion", "verification_plots.simulated_motion_figure"),
)


def verification_view(verification: Verification, name: str = "") -> View:
    """View of a verification, whose files begin with a name."""
    v, log = verification, verification.log
    name = name or f"verification-{PurePath(log.file).stem}"
    robot = {} if v.robot is None else {"robot": v.robot.name, "robot_sha256": v.robot.sha256()}
    return View(
        kind="verification",
        title=f"verification on {log.file}",
        verdict=v.verdict.text,
        holds=v.holds,
        numbers=(
            (f"torques missed on {PurePath(log.file).stem}", percent(v.relative_error, 3)),
            ("joints confirmed", f"{len(v.verdict.confirmed)} of {len(v.torques)}"),
            ("largest drift when simulated", percent(max((m.relative for m in v.motions or ()), default=math.nan), 2)),
        ),
        summary=(_predicted(v), *v.verdict.answers),
        remarks=(*v.verdict.remarks, *log.notes),
        asked=tuple((f"tolerance of the {name}", f"{100 * value:g} %") for name, value in vars(v.tolerances).items()),
        tables=(_torques(v), _parts(v), _motions(v)),
        figures=tuple(
            each.of(v) for each in _DRAWN if len(v.time) and (each.ending != "motion" or v.replay is not None)
        ),
        filed=name,
        stem=f"{name}_",
        facts={**robot, "log": log.file, "log_sha256": log.sha256},
    )


def verifications_view(judged: Sequence[Verification]) -> View:
    """View of the verifications of one result, of which those that do not hold are first."""
    negative = sum(not each.holds for each in judged)
    worse = f"Do not rely on the result: it does not hold on {negative} of {len(judged)} logs."
    better = f"The result predicts each of {len(judged)} logs: you can rely on it for motions of these kinds."
    columns = headed("*log:text, *verdict:text, *error of torques:%, *largest of a motion:%")
    rows = []
    for v in sorted(judged, key=lambda each: each.holds):
        largest = max((m.relative for m in v.motions or () if math.isfinite(m.relative)), default=None)
        rows.append((v.log.file, "holds" if v.holds else "DOES NOT HOLD", v.relative_error, largest))
    return View(
        kind="verification",
        title=f"verification on {len(judged)} logs",
        verdict=worse if negative else better,
        holds=not negative,
        remarks=tuple(f"{v.log.file}: {text}" for v in judged for text in (*v.verdict.against, *v.verdict.remarks)),
        tables=(ViewTable("logs", "Verdict on each log", columns, tuple(rows)),),
    )


def _predicted(v: Verification) -> str:
    identified = "" if v.training_error is None else f" ({percent(v.training_error, 3)} where identified)"
    return (
        f"{v.log.file}: {v.log.rows} rows; predicted torques miss {percent(v.relative_error, 3)} of what was "
        f"measured{identified}; {100 * v.tolerances.torque:g} % apart from noise is allowed"
    )


def _torques(v: Verification) -> ViewTable:
    moved = {motion.name: motion.relative for motion in v.motions or ()}
    says = dict.fromkeys(v.verdict.confirmed, "confirms") | dict.fromkeys(v.verdict.contradicted, "contradicts")
    says |= dict.fromkeys(v.verdict.undecided, "cannot judge") | dict.fromkeys(v.verdict.unknown, "shows more")
    less: Sequence[float | None] = [part.relative for part in v.corrected] or [None] * len(v.torques)
    columns = headed(
        "*equation:text, measured, *torque error, *unit:unit, *of measured:%, less noise:%, *this log:text, "
        "*simulated motion:%, worst, at [s]"
    )
    rows = tuple(
        (t.name, t.measured, t.error, t.unit, t.relative, x, says.get(t.name), moved.get(t.name), t.worst, t.worst_time)
        for t, x in zip(v.torques, less, strict=True)
    )
    return ViewTable("torques", "Predicted against measured", columns, rows)


def _parts(v: Verification) -> ViewTable:
    columns = headed("equation:text, noise:%, standstill:%, model:%, limited by:text")
    rows = tuple((t.name, t.noise, t.standstill, t.systematic, t.limited_by) for t in v.torques)
    return ViewTable("parts", "What the errors are made of", columns, rows)


def _motions(v: Verification) -> ViewTable:
    columns = headed("joint:text, travel, error, unit:unit, of travel:%, worst, at [s]")
    rows = tuple((m.name, m.travel, m.error, m.unit, m.relative, m.worst, m.worst_time) for m in v.motions or ())
    return ViewTable("motions", "Simulated against measured motion", columns, rows)


_NEGLIGIBLE = 1e-4  # tracking error over the range of motion


def simulation_view(simulation: Simulation | SimulatedLog) -> View:
    """View of a simulation, or of what was written of one."""
    log = simulation.record if isinstance(simulation, Simulation) else simulation
    what, settings = f"{log.duration:g} s of {log.robot}", log.settings
    lost = f"the motion does not hold: {listed_names(log.failures, 3)}"
    kept = f"the motion was followed{_followed(log)}"
    return View(
        kind="simulation",
        title=f"simulation of {log.robot}",
        verdict=f"Simulated {what}: {kept}" if log.holds else f"Simulated {what}, but {lost}",
        holds=log.holds,
        summary=(
            f"{log.samples} samples at {settings['rate']:g} Hz; {_driven(log)}, seed {log.seed}",
            f"energy: the torques did {log.work:.4g} J of work, friction took {log.loss:.4g} J; the balance closes to "
            f"{log.energy_residual:.2g} J",
        ),
        remarks=(*(f"does not hold: {each}" for each in log.failures), *log.notes),
        tables=(_simulated_torques(log), _tracking(log), *(() if log.tracked is None else (_criteria(log.tracked),))),
        facts={"robot": log.robot, "robot_sha256": log.sha256},
    )


def _driven(log: SimulatedLog) -> str:
    """What moved the robot."""
    if log.settings["controller"] is None:
        return "no controller"
    if log.tracked is None:
        return f"{log.settings['controller']} of {log.settings['bandwidth']:g} Hz"
    commanded, tracked = (log.tracked[name]["condition_number"] for name in ("commanded", "tracked"))
    return f"identified servos; condition number {tracked:.4g} of the tracked motion, {commanded:.4g} of the commands"


def _criteria(tracked: Mapping[str, Mapping[str, float]]) -> ViewTable:
    rows = tuple((name, value, tracked["tracked"][name]) for name, value in tracked["commanded"].items())
    return ViewTable("criteria", "Criteria", headed("criterion:text, commanded:4, tracked:4"), rows, most=6)


def _followed(log: SimulatedLog) -> str:
    if not log.tracking:
        return ""
    worst = max(log.tracking, key=lambda each: each.relative)
    if worst.relative < _NEGLIGIBLE:
        return f" within {100 * _NEGLIGIBLE:g} % of its range of motion"
    deviation = f"{worst.joint}: {worst.error:.2g} {worst.unit}"
    return f" within {percent(worst.relative)} of its range of motion ({deviation})"


def _simulated_torques(log: SimulatedLog) -> ViewTable:
    columns = headed("*torque limit of:text, *peak:4, *limit:4, *used:%, *samples at the limit")
    uses = sorted(log.torques, key=lambda use: -use.peak / use.limit)
    rows = tuple((use.label, use.peak, use.limit, use.peak / use.limit, use.saturated) for use in uses)
    return ViewTable("torques", "Commanded torques", columns, rows, most=7)


def _tracking(log: SimulatedLog) -> ViewTable:
    rows = tuple((each.joint, each.error, each.rms, each.unit) for each in log.tracking)
    return ViewTable("tracking", "Tracking error", headed("joint:text, largest, rms, unit:unit"), rows)
