"""What of a robot's description is most likely to blame where no motion within the limits is found."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from constraints.bounds.certificate import LimitUse
from constraints.feasibility.diagnosis import ContradictionError
from excite.errors import NoFeasibleMotionError
from excite.information.rounded_angles import rounded_angles
from regressors.robot.robot import Robot

_NEARLY_USED = 0.9  # a limit that is used less does not hinder a motion


@contextmanager
def suspecting(robot: Robot) -> Iterator[None]:
    """Put the most suspicious thing of a description before the message that no motion keeps the limits."""
    try:
        yield
    except (ContradictionError, NoFeasibleMotionError) as error:
        if doubts := _doubts(robot, str(error)):
            more = f" (and {len(doubts) - 1} more, see the notes)" if len(doubts) > 1 else ""
            raise type(error)(f"look at the description first: {doubts[0]}{more}; {error}") from error
        raise


def _doubts(robot: Robot, message: str) -> list[str]:
    """Suspicious findings, those on joints and links that the message names first; then angles as if rounded."""
    named = _words(message) - {"joint", "joints", "link", "links"}
    notes = [note for note in robot.notes if note.kind == "suspicious"]
    notes.sort(key=lambda note: named.isdisjoint(_words(note.where)))
    angles = [f"{angle}, as if an angle had been rounded; state angles exactly" for angle in rounded_angles(robot)]
    return [*map(str, notes), *angles]


def _words(text: str) -> set[str]:
    """Words without the punctuation around them."""
    return {word.strip(".,:;()'\"") for word in text.split()}


def unidentifiable(uses: tuple[LimitUse, ...]) -> str:
    """Message that motions within the limits do not show every parameter, and what would help.

    A limit is not to be widened unless the motion comes near to it.
    """
    said = "no start found a motion within the limits from which every parameter is identifiable"
    use = max(uses, key=lambda use: use.use, default=None)
    cures = "give more `harmonics` or a longer `period`, or leave parameters out with `nearly_unidentifiable='drop'`"
    if use is None or use.use <= _NEARLY_USED:
        closest = "" if use is None else f": the one used most, {use.label}, is used at {100 * use.use:.0f} %"
        return f"{said}, and limits are not the cause{closest}; {cures}"
    return (
        f"{said}; the limit used most is that of {use.label}, {100 * use.use:.0f} % of {use.bound:.4g} {use.unit}: "
        f"widen it if the robot allows more, or {cures}"
    )
