"""Runs of one coordinate in a friction measurement: warm-up, break-away tests, then every speed there and back."""

from __future__ import annotations

from dataclasses import dataclass

from excite.friction.plan.runs import LEAST_RUN, Pace, Part, Runs
from excite.friction.plan.schedule import Schedule, alternating
from regressors.errors import InputError

WARM_UP, TRANSFER = "warm-up", "transfer"


@dataclass(frozen=True, eq=False)
class RunSequence:
    """Runs of one coordinate."""

    runs: Runs
    breakaways: tuple[Part, ...]  # creeping runs out of the pose and back, for the break-away tests
    # parts with a window of constant speed, and the speed in percent of the largest one, in the order of execution
    windowed: tuple[tuple[Part, float], ...]
    strokes: dict[float, float]  # stroke to both sides of the pose for each speed [%, rad or m]
    left_out: dict[float, str]  # speeds that are left out [%], and why


def run_sequence_of(
    schedule: Schedule, pace: Pace, half: float, label: str, unit: str, because: str = ""
) -> RunSequence:
    """Build the runs of a schedule within the range of a place; empty where no speed leaves a window."""
    half = min(half, schedule.stroke)
    strokes, left_out = _strokes(schedule, pace, half, unit, because)
    runs = Runs(pace, schedule.rate)
    if not strokes:
        return RunSequence(runs, (), (), strokes, left_out)
    _warm_up(runs, schedule, strokes)
    breakaways = _breakaways(runs, schedule, label, half)
    windowed = _there_and_back(runs, schedule, label, strokes)
    runs.go(TRANSFER, 0.0, 0.5 * pace.velocity)
    runs.wait(schedule.pause)
    return RunSequence(runs, breakaways, windowed, strokes, left_out)


def _strokes(
    schedule: Schedule, pace: Pace, half: float, unit: str, because: str
) -> tuple[dict[float, float], dict[float, str]]:
    """Stroke to both sides for each speed, and the speeds that leave no window, with the reason."""
    strokes: dict[float, float] = {}
    left_out: dict[float, str] = {}
    for percent in sorted(schedule.percent):
        speed = pace.velocity * percent / 100.0
        ramp = pace.ramp(speed)
        stroke = min(half, ramp + 0.5 * speed * schedule.longest)
        window = max(2.0 * (stroke - ramp) / speed, 0.0)
        if window < schedule.shortest * (1.0 - 1e-9):
            left_out[percent] = (
                f"in a stroke of {max(half, 0.0):.3g} {unit} to each side{because}, ramps of {ramp:.3g} {unit} leave "
                f"{window:.2g} s of constant speed, less than the shortest window of {schedule.shortest:g} s"
            )
        elif stroke <= LEAST_RUN:
            left_out[percent] = f"a stroke of {stroke:.3g} {unit} to each side is too short for a run"
        else:
            strokes[percent] = stroke
    return strokes, left_out


def _warm_up(runs: Runs, schedule: Schedule, strokes: dict[float, float]) -> None:
    """There and back at the speed nearest to half of the largest, until the time is over."""
    if schedule.warm_up == 0.0:
        return
    percent = min(strokes, key=lambda p: abs(p - 50.0))
    speed, stroke = runs.pace.velocity * percent / 100.0, strokes[percent]
    while runs.duration < schedule.warm_up:
        runs.go(WARM_UP, -stroke, speed)
        runs.go(WARM_UP, stroke, speed)
    runs.go(WARM_UP, 0.0, speed)


def _breakaways(runs: Runs, schedule: Schedule, label: str, half: float) -> tuple[Part, ...]:
    """Creeping runs out of the pose and back, each after a rest: the torque rises until the coordinate breaks away."""
    speed = runs.pace.velocity * schedule.creep / 100.0
    distance = min(speed * schedule.creeping, half)
    if schedule.breakaways and distance <= LEAST_RUN:
        raise InputError(
            f"{label}: the break-away tests creep only {distance:.3g} far, at {speed:.3g} per second for "
            f"{schedule.creeping:g} s: give more `creeping`, more `creep`, or `breakaways=0`"
        )
    parts: list[Part] = []
    for _ in range(schedule.breakaways):
        for sign, end in (("+", distance), ("-", 0.0)):
            runs.wait(max(schedule.pause, 1.0))
            part = runs.go(f"{label} stiction {sign}", end, speed)
            assert part is not None
            parts.append(part)
    runs.wait(schedule.pause)
    return tuple(parts)


def _there_and_back(
    runs: Runs, schedule: Schedule, label: str, strokes: dict[float, float]
) -> tuple[tuple[Part, float], ...]:
    """Every speed in both directions, in an order that keeps the temperature steady."""
    parts = []
    for percent in alternating(list(strokes)) * schedule.repeats:
        speed, stroke = runs.pace.velocity * percent / 100.0, strokes[percent]
        runs.go(TRANSFER, -stroke, 0.5 * runs.pace.velocity)
        for sign, end in (("+", stroke), ("-", -stroke)):
            runs.wait(schedule.pause)
            part = runs.go(f"{label} {sign}{percent:g} %", end, speed)
            assert part is not None
            parts.append((part, percent))
    runs.wait(schedule.pause)
    return tuple(parts)
