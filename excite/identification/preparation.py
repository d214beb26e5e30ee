"""From a log to the filtered motion and the measurements of its equations, without rows that make none."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import numpy as np
import scipy

from excite.identification.recipe import ALL, AUTO, Recipe
from excite.information.target import IdentificationTarget
from excite.logs.cleaning import cleaned
from excite.logs.event import (
    FORCE,
    IMPACT,
    LEAST,
    LEFT_OUT,
    SATURATION,
    Event,
    Saturation,
    Spans,
    event_notes,
    events_in,
    joined_spans,
    measured_saturation,
    missing_rows,
    spans_of,
    within,
)
from excite.logs.excitation import exciting_rows
from excite.logs.impacts import check_resets, impact_events
from excite.logs.log import Log
from excite.logs.log_checks import check_log, joints_of
from excite.logs.signals.method import FilteredMotion, Method, Resampled, delayed, resample, signal_method
from excite.logs.signals.periods import average_periods, repeats
from regressors.errors import InputError, UnknownName
from regressors.robot.friction.load_and_temperature import drives_with_friction, torques_at_drives
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

HELD = 0.01  # largest motion of a joint that the model holds [rad or m]


@dataclass(frozen=True, eq=False)
class PreparedLog:
    """One log, ready for the model."""

    log: Log  # the stretch that is used, moving joints only, as recorded
    samples: Samples  # its motion at N uniform instants
    measured: Array  # (N, n) joint torques [Nm or N], or (N, 6) the wrench [N, Nm], at those instants
    notes: tuple[str, ...]  # what was cut, repaired and assumed
    temperature: Array | None = None  # (N, n) of the joints at those instants, where it is known [deg C]
    left_out: Spans = ()  # first and last instant of the stretches that make no equations [s]
    events: tuple[Event, ...] = ()  # what happened in it, and why these are left out
    # stretches that make no rows of each equation, where friction may hold a drive, see `excite.identification.biases`
    standing: tuple[Spans, ...] = ()

    @property
    def saturated(self) -> Spans:
        """Spans of the stretches in which a torque was at its limit [s]."""
        return spans_left_out([event for event in self.events if event.kind == SATURATION])

    @property
    def left_out_share(self) -> float:
        """Share of the instants that make no equations."""
        return float(np.mean(within(self.samples.time, self.left_out)))


def prepare(log: Log, robot: Robot, target: IdentificationTarget, recipe: Recipe) -> PreparedLog:
    """Prepare the motion and the measurements of one log."""
    own = recipe.delay if isinstance(recipe.delay, tuple) else None
    asked = (
        robot,
        target.robot.joint_names,
        target.model.channel,
        recipe.rows,
        recipe.torque_factors,
        recipe.bias,
        own,
    )
    if log not in _KNOWN or _KNOWN[log][0] != asked:
        _KNOWN[log] = asked, _usable_rows(log, robot, target, recipe)
    return _with_motion(_KNOWN[log][1], target, recipe)


@dataclass(frozen=True, eq=False)
class UsableRows:
    """The rows of a log that are used, before its motion is found."""

    recorded: Log  # the stretch that is used, every joint
    moving: Log  # its moving joints
    smooth: Log  # those without impacts
    resampled: Resampled  # these at uniform instants
    found: tuple[Event, ...]  # by cleaning
    hits: tuple[Event, ...]  # impacts
    saturated: tuple[Event, ...]
    notes: tuple[str, ...]  # what was cut and repaired; on torques at their limits
    remarks: tuple[str, ...]


# of the last settings that a log was used with: what is chosen for it, and the estimate, use the same rows
_KNOWN: WeakKeyDictionary[Log, tuple[tuple[object, ...], UsableRows]] = WeakKeyDictionary()


def _usable_rows(log: Log, robot: Robot, target: IdentificationTarget, recipe: Recipe) -> UsableRows:
    """Clean a log, and find its exciting rows and what happened in them."""
    joints_of(log, robot)
    # a copy: what is kept for a log must not hold it
    log, found = cleaned(replace(_rows_asked_for(log, recipe)), robot)
    notes = []
    names = target.robot.joint_names
    if absent := [name for name in names if name not in log.joints]:
        raise InputError(
            f"{log.source} has the joints {', '.join(log.joints)}, but not {', '.join(absent)}, which the model moves; "
            "record them too, or choose the joints (`joints`) or the part of the robot (`tip`) that the log has"
        )
    moving = log.of(names)
    if recipe.rows == AUTO:
        stretch, reason = exciting_rows(moving)
        notes.append(reason)
        log, moving = log.rows(stretch), moving.rows(stretch)
    check_resets(log, robot)
    notes = [*log.left_out, *check_log(log, robot), *notes]
    notes += _held_joints(log, robot, target)
    saturated, remarks = saturated_stretches(log, robot, target, recipe)
    moving = corrected(moving, target.robot, recipe)
    with _errors_naming(log):
        smooth, hits = without_impacts(moving, target.robot, recipe)
        uniform = resample(smooth)
    return UsableRows(log, moving, smooth, uniform, found, hits, saturated, tuple(notes), tuple(remarks))


def _with_motion(rows: UsableRows, target: IdentificationTarget, recipe: Recipe) -> PreparedLog:
    """The motion and the measurements of the rows that are used."""
    log = rows.recorded
    with _errors_naming(log):
        uniform, motion, steps = _motion(rows.resampled, recipe)
    cut = float(motion.samples.time[0] - uniform.time[0])
    pushed = events_in(log, FORCE, log.external_forces, "torques that no parameters explain")
    events = (*rows.found, *stretches_left_out(rows.smooth, cut, rows.hits), *pushed)
    notes = [*rows.notes, *event_notes(events, 1.0 / log.rate), *rows.remarks, *steps]
    events = (*events, *rows.saturated)
    spans = (*spans_left_out(events), *_unknown_ends(uniform.time, recipe))
    measured = measured_channel(uniform, target)[motion.kept]
    samples = delayed(motion.samples, recipe.delay_of(log.source))
    temperature = _temperature(uniform, recipe)
    return PreparedLog(
        rows.moving,
        _on_the_motion(samples, log, target),
        measured,
        tuple(notes),
        None if temperature is None else temperature[motion.kept],
        spans_in_mean(spans, uniform) if recipe.average else spans,
        events,
    )


def _unknown_ends(time: Array, recipe: Recipe) -> Spans:
    """Ends of a log that lack the torques of joints with other delays than the common one."""
    reach = float(np.abs(np.asarray(recipe.delay) - recipe.common_delay).max())
    first, last = float(time[0]), float(time[-1])
    return ((first, first + reach), (last - reach, last)) if reach else ()


def _rows_asked_for(log: Log, recipe: Recipe) -> Log:
    """The rows of a log that are asked for by number."""
    numbers = log.row_numbers
    last = max(int(numbers[-1]), *(int(part.numbers[-1]) for part in log.removed if part.numbers.size), 0)
    with _errors_naming(log):
        asked = recipe.stretch(last)
    if asked is None or recipe.rows == ALL:
        return log
    return log.rows(slice(*(int(k) for k in np.searchsorted(numbers, [asked.start + 1, asked.stop + 1]))))


def _motion(resampled: Resampled, recipe: Recipe) -> tuple[Log, FilteredMotion, list[str]]:
    """Log at uniform instants, averaged where that is asked for; its motion; and notes on the steps."""
    notes = [resampled.note]
    uniform = resampled.log
    if recipe.average:
        uniform, period, note = average_periods(uniform, recipe.period)
        recipe = replace(recipe, period=period)
        notes.append(note)
    if recipe.signals_chosen and (why := _does_not_apply(uniform, recipe)):
        notes.append(f"{why}: positions are low-passed instead")
        recipe = replace(recipe, signals="butterworth", measured_velocity=False)
    motion = chosen_method(recipe).motion(uniform.time, uniform.q, uniform.dq if recipe.measured_velocity else None)
    return uniform, motion, [*notes, motion.assumed]


def _does_not_apply(uniform: Log, recipe: Recipe) -> str:
    """Why a log does not have what a chosen method needs; empty where it has."""
    if recipe.measured_velocity and uniform.dq is None:
        return "no velocities were measured"
    if recipe.signals == "fourier" and recipe.period is None and not repeats(uniform.time, uniform.q):
        return "the motion does not repeat itself"
    return ""


def _temperature(log: Log, recipe: Recipe) -> Array | None:
    """Temperatures of a log's joints: its own, or else those of the recipe."""
    given, n = recipe.temperature, len(log.joints)
    if log.temperature is not None or given is None:
        return log.temperature
    if len(given) not in (1, n):
        raise InputError(
            f"temperature needs one value, or {n}, one per joint of {', '.join(log.joints)}; given {len(given)}"
        )
    return np.tile(np.broadcast_to(given, n), (log.count, 1))


@contextmanager
def _errors_naming(log: Log) -> Iterator[None]:
    """Prefix input errors raised in the block with the name of the log."""
    try:
        yield
    except InputError as error:
        text = str(error)
        raise InputError(text if text.startswith(log.source) else f"{log.source}: {text}") from error


def _on_the_motion(samples: Samples, log: Log, target: IdentificationTarget) -> Samples:
    """Project the measured motion onto a partial motion, whose held coordinates may only show noise."""
    if target.motion.complete:
        return samples
    moved = target.motion.states(samples)
    astray = np.abs(moved.q - samples.q).max(axis=0)
    worst = int(np.argmax(astray))
    if astray[worst] > HELD:
        cure = "" if target.motion.straight else "; check the points of the loops, and zeros and signs of the joints"
        raise InputError(
            f"{log.source}: joint {target.robot.joint_names[worst]} deviates by {astray[worst]:.3g} "
            f"{target.robot.joints[worst].unit} from a motion of {', '.join(target.motion.labels)} alone{cure}"
        )
    return moved


def chosen_method(recipe: Recipe) -> Method:
    """Method from positions to accelerations that a recipe asks for."""
    given = {"cutoff": recipe.cutoff, "harmonics": recipe.harmonics}
    if recipe.signals == "fourier":
        given["period"] = recipe.period
        if recipe.signals_chosen:  # the cutoff is for logs to which it does not apply
            given["cutoff"] = None
    settings = {name: value for name, value in given.items() if value is not None}
    return signal_method(recipe.signals, measured_velocity=recipe.measured_velocity, **settings)


def measured_channel(log: Log, target: IdentificationTarget) -> Array:
    """Channel of a log that a target's equations predict, as recorded: joint torques or the wrench."""
    wanted = target.model.channel
    channel: Array | None = getattr(log, wanted)
    if channel is None:
        names = "wrench.force.x ... wrench.torque.z" if wanted == "wrench" else "NAME.effort of every moving joint"
        raise InputError(f"{log.source} has no {wanted}: the model needs the columns {names}")
    return channel


def _held_joints(log: Log, robot: Robot, target: IdentificationTarget) -> list[str]:
    """Check that the joints that the model holds rest in the log, at the positions of the model."""
    limits = robot.limits
    rest = np.clip(np.zeros(robot.n), limits.lower, limits.upper)
    for k, name in enumerate(robot.joint_names):
        if name in target.robot.joint_names or name not in log.joints:
            continue
        q = log.q[:, log.joints.index(name)]
        unit = robot.joints[k].unit
        if np.ptp(q) > HELD:
            raise InputError(
                f"{log.source}: joint {name} moves by {np.ptp(q):.3g} {unit}, but the model holds it; "
                f"moving joints of the model: {', '.join(target.robot.joint_names)}"
            )
        if abs(q.mean() - rest[k]) > HELD:
            raise InputError(
                f"{log.source}: joint {name} rests at {q.mean():.4g} {unit}, "
                f"but the model holds it at {rest[k]:.4g} {unit}; record it there, let the model move it too "
                "(`joints`), or choose a part of the robot without it (`base_link`, `tip`)"
            )
    absent = [n for n in robot.joint_names if n not in target.robot.joint_names and n not in log.joints]
    return [f"{', '.join(absent)}: not in the log, assumed to stand still"] if absent else []


_MOST_SATURATED = 0.5  # of the rows: a motion whose larger part is missing is no longer the one that was designed


def saturated_stretches(
    log: Log, robot: Robot, target: IdentificationTarget, recipe: Recipe
) -> tuple[tuple[Event, ...], list[str]]:
    """Stretches in which the log has torques at their limits, known or as they look, and the notes on them."""
    if target.model.channel != "effort":
        return (), []
    saturated = log.saturated or measured_saturation(log.of(joints_of(log, robot)[0]), robot)
    spans = spans_of(saturated)
    lost = within(log.time, spans)
    count = int(np.count_nonzero(lost))
    if not count:
        return (), []
    step = float(np.median(np.diff(log.time)))
    torques = _torques(saturated, log)
    rows = f"{count} rows ({count * step:.3g} s) in which {torques}"
    if recipe.rows != AUTO:
        return (), [f"used, since they were asked for: {rows}"]
    if count > _MOST_SATURATED * log.count:
        raise InputError(
            f"{log.source}: in {count} of its {log.count} exciting rows {torques}, so too little is left of it; "
            "record a motion of lower torques (design it with `torque_margin`), or, if the recorded torques are those "
            "that acted, use every row (`rows='all'`)"
        )
    return tuple(events_in(log, SATURATION, spans, torques)), [f"{LEFT_OUT} {rows}"]


def _torques(saturated: tuple[Saturation, ...], log: Log) -> str:
    present = [one.label for one in saturated if np.any(within(log.time, one.spans))]
    if len(present) == 1:
        return f"the torque of {present[0]} was at its limit"
    return f"the torques of {', '.join(present)} were at their limits"


def spans_in_mean(spans: Spans, mean: Log) -> Spans:
    """The stretches of all periods within the mean of them."""
    start, step = float(mean.time[0]), mean.duration / (mean.count - 1)
    period, phases = mean.count * step, mean.time - mean.time[0]
    lost = np.zeros(mean.count, dtype=bool)
    for first, last in spans:
        begin = (first - start) % period
        end = begin + (last - first)
        for shift in (0.0, period):  # what passes the period's end goes on at its beginning
            lost |= (phases + shift >= begin - step / 2) & (phases + shift <= end + step / 2)
    return tuple((float(t) - step / 2, float(t) + step / 2) for t in mean.time[lost])


_SMEAR = 0.25  # of what a filter cuts at each end: half a period of its cutoff
_LEAST_SMEAR = 0.03  # [s]


def without_impacts(used: Log, robot: Robot, recipe: Recipe) -> tuple[Log, tuple[Event, ...]]:
    """The log without the rows about impacts, which would spread over the filtered motion, and these impacts."""
    units = [robot.joints[robot.joint_index(name)].unit for name in used.joints]
    hits = impact_events(resample(used).log, used, units)
    if recipe.rows == ALL:  # they stay
        return used, tuple(replace(event, left_out=False) for event in hits)
    about = within(used.time, tuple((event.begin, event.end) for event in hits))
    return (used.without(IMPACT, about) if hits else used), hits


def stretches_left_out(smooth: Log, cut: float, hits: Sequence[Event]) -> tuple[Event, ...]:
    """Where rows are missing, and impacts, with half a period of the filter's cutoff on either side of long ones."""
    smear = max(_LEAST_SMEAR, _SMEAR * cut)
    lost = [event for event in missing_rows(smooth) if event.kind != IMPACT]
    return tuple(
        replace(one, begin=one.begin - smear, end=one.end + smear) if one.left_out and one.seconds > LEAST else one
        for one in (*lost, *hits)
    )


def spans_left_out(events: Sequence[Event]) -> Spans:
    """Spans of time of the events that make no equations, joined where they overlap [s]."""
    return joined_spans((event.begin, event.end) for event in events if event.left_out)


def drives_of_torques(robot: Robot, *, each: bool) -> tuple[tuple[str, ...], Array]:
    """Drives whose torques are measured, and the matrix D from joint torques to theirs."""
    names = tuple(name for name, _ in drives_with_friction(robot))
    if len(names) == robot.n:
        return names, torques_at_drives(robot)
    if each:
        raise InputError(
            f"the torques of {robot.n} joints do not determine the gains of {len(names)} drives ({', '.join(names)}); "
            "give `gains='common'`"
        )
    return robot.joint_names, np.eye(robot.n)


def corrected(log: Log, robot: Robot, recipe: Recipe) -> Log:
    """A log of the moving joints, its torques in corrected gains and with a common delay, its wrench without bias."""
    factors, bias = recipe.torque_factors, recipe.bias or ()
    if factors and log.effort is None:
        raise InputError(f"{log.source}: `torque_factors` are for joint torques, which it does not have")
    if any(bias) and log.wrench is None:
        raise InputError(f"{log.source}: `bias` is for the wrench of a sensor, which it does not have")
    if factors and log.effort is not None:
        log = replace(log, effort=log.effort @ correction(robot, dict(factors)).T)
    if isinstance(recipe.delay, tuple):
        log = replace(log, effort=_with_common_delay(log, recipe.delay, recipe.common_delay))
    return replace(log, wrench=log.wrench - bias) if any(bias) and log.wrench is not None else log


def _with_common_delay(log: Log, delays: Sequence[float], common: float) -> Array:
    """Torques as if those of every joint had the common delay: those of the others are interpolated."""
    if log.effort is None or len(delays) != len(log.joints):
        names = f"{len(log.joints)}, one of each of {', '.join(log.joints)}"
        raise InputError(f"{log.source}: `delay` needs one value, or, of joint torques, {names}; given {len(delays)}")
    moved = log.effort.copy()
    for k, late in enumerate(delays):
        if late != common:
            at = np.clip(log.time + (late - common), log.time[0], log.time[-1])
            moved[:, k] = scipy.interpolate.PchipInterpolator(log.time, log.effort[:, k])(at)
    return moved


def correction(robot: Robot, factors: Mapping[str, float]) -> Array:
    """``D^-1 diag(g) D``, which corrects joint torques, shape (n, n)."""
    known = {*(name for name, _ in drives_with_friction(robot)), *robot.joint_names}
    for name in factors:
        if name not in known:
            raise UnknownName("drive", name, sorted(known))
    names, D = drives_of_torques(robot, each=len(set(factors.values())) > 1)
    g = np.array([factors.get(name, 1.0) for name in names])
    return np.asarray(np.linalg.solve(D, g[:, None] * D))
