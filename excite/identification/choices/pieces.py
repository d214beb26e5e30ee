"""Stretches of the logs on which settings are tried."""

from __future__ import annotations

from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget
from excite.logs.excitation import exciting_rows
from excite.logs.log import Log

_LONGEST = 100_000  # rows of a log that are tried
_PIECES = 5


def exciting_pieces(log: Log, target: IdentificationTarget, recipe: Recipe) -> list[Log]:
    """The exciting stretch of a log, or evenly spaced pieces of a very long one.

    Parameters
    ----------
    log : Log
    target : IdentificationTarget
        Its moving joints.
    recipe : Recipe
        Which rows are asked for.
    """
    stretch = recipe.stretch(log.count)
    if stretch is None:
        stretch, _ = exciting_rows(log.of(target.robot.joint_names))
    first, last = stretch.start, stretch.stop
    if last - first <= _LONGEST:
        return [log.rows(stretch)]
    length = _LONGEST // _PIECES
    spacing = (last - first - length) // (_PIECES - 1)
    return [log.rows(slice(first + k * spacing, first + k * spacing + length)) for k in range(_PIECES)]
