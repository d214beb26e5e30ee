"""What is proven of closed motions between instants, beside many instants."""

from __future__ import annotations

from functools import cache, partial

import numpy as np
import pytest
from linkages import FOUR_BAR, PARALLELOGRAM, linkage, robot_of_text
from mechanisms import delta

from constraints import closed_loops
from constraints.closed_loops import LoopProof
from regressors.models.partial import ClosedMotion, of_loops
from regressors.samples import Array, Samples

TEXTS = {
    "four-bar": linkage("four-bar", FOUR_BAR),
    "parallelogram": linkage("parallelogram", PARALLELOGRAM),
    "delta": delta(),
}


@cache
def motion_of(name: str) -> ClosedMotion:
    return of_loops(robot_of_text(name, TEXTS[name]))


def swinging(motion: ClosedMotion, amplitude: float, middle: float, w: float, time: Array) -> Samples:
    """All independent joints on sines, each of its own phase, and what follows them."""
    loops = motion.loops
    angle = w * time[:, None] + np.arange(len(loops.independent))
    waves = (np.sin(angle), w * np.cos(angle), -(w**2) * np.sin(angle), -(w**3) * np.cos(angle))
    q, rates = np.zeros((time.size, loops.robot.n)), np.zeros((3, time.size, loops.robot.n))
    free = middle + amplitude * waves[0]
    q, left = loops.solved(free)
    loops.check(time, q, left, "swing")
    rates[:, :, list(loops.independent)] = [amplitude * wave for wave in waves[1:]]
    return loops.rates(Samples(time, q, *rates))


SWINGS = {
    "four-bar": ("four-bar", 1.5, 0.2, 3.0),
    "four-bar, all round": ("four-bar", 4.0, 0.0, 1.5),
    "parallelogram": ("parallelogram", 0.8, 0.5, 4.0),
    "delta": ("delta", 0.4, 0.1, 4.0),
}


@pytest.mark.parametrize(("name", "amplitude", "middle", "w"), SWINGS.values(), ids=SWINGS)
def test_no_joint_jerks_more_than_is_proven(name: str, amplitude: float, middle: float, w: float) -> None:
    motion, duration = motion_of(name), 2 * np.pi / w
    jerk = np.full(len(motion.labels), amplitude * w**3)
    proof = LoopProof.of(motion, partial(swinging, motion, amplitude, middle, w), duration, jerk)
    reached = np.abs(swinging(motion, amplitude, middle, w, np.linspace(0.0, duration, 20_001)).dddq).max(axis=0)
    assert np.all(reached <= proof.jerk * (1.0 + 1e-12))
    dependent = list(motion.loops.dependent)
    assert np.all(proof.jerk[dependent] <= 4.0 * np.maximum(reached[dependent], 1e-6 * reached.max()) + 1e-3)
    assert proof.use.holds


def test_bounds_reach_as_far_as_the_jerk_of_the_crank_from_a_middle_at_rest(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(closed_loops, "_PARTS", (1,))
    motion, jerk, duration = motion_of("four-bar"), 600.0, 0.05

    def samples(time: Array) -> Samples:
        loops, t = motion.loops, time[:, None] - duration / 2
        q, left = loops.solved(0.2 + jerk * t**3 / 6)
        loops.check(time, q, left, "cubic")
        rates = np.zeros((3, *q.shape))
        rates[:, :, list(loops.independent)] = jerk * t**2 / 2, jerk * t, np.full_like(t, jerk)
        return loops.rates(Samples(time, q, *rates))

    proof = LoopProof.of(motion, samples, duration, np.array([jerk]))
    around = samples(np.linspace(-duration / 2, 1.5 * duration, 401))  # as far as the box of one middle
    middle, reached = (np.abs(each.dddq).max(axis=0) for each in (samples(np.array([duration / 2])), around))
    assert np.all(np.isfinite(proof.jerk))
    assert np.any(reached > 1.02 * middle)
    assert np.all(reached <= proof.jerk)


def test_boxes_hold_the_positions_around_their_middles() -> None:
    """The same with jumps between instants, which must not pass for a continuous motion."""
    motion, duration, jumps = motion_of("four-bar"), 2.0, 0.3

    def samples(time: Array) -> Samples:
        there = swinging(motion, 0.5, 0.0, np.pi, time)
        q = there.q.copy()
        q[time > 1.0, 1:] += jumps
        return Samples(time, q, there.dq, there.ddq, there.dddq)

    proof = LoopProof.of(motion, samples, duration, np.array([0.5 * np.pi**3]))
    assert not np.all(np.isfinite(proof.jerk))
    assert not proof.use.holds
    assert proof.use.use > 1.0


def test_a_parallelogram_that_comes_near_the_line_in_which_it_folds_is_less_regular() -> None:
    motion = motion_of("parallelogram")
    regular = []
    for amplitude in (0.5, 1.0, 1.4):
        samples = partial(swinging, motion, amplitude, np.pi / 6, 1.0)
        regular.append(LoopProof.of(motion, samples, 2 * np.pi, np.array([amplitude])).regular)
    assert regular[0] > regular[1] > regular[2] > 0
