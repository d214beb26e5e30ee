"""Drives whose friction a model identifies: those that were asked for and have no curve."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from regressors.errors import UnknownName

if TYPE_CHECKING:
    from regressors.friction.curves import FrictionCurves
    from regressors.models.columns import Drives
    from regressors.robot.robot import Robot


def drives_with_columns(wanted: bool | Sequence[str], robot: Robot, curves: FrictionCurves | None) -> Drives:
    """Drives with columns of one kind of friction, by number.

    Parameters
    ----------
    wanted : bool or sequence of str
        All drives, none, or those of these names or numbers.
    robot : Robot
        With its moving joints only.
    curves : FrictionCurves, optional
        Known friction; its drives get no columns.

    Returns
    -------
    bool or tuple of int
        True and False where it is all or none of the moving drives.

    Raises
    ------
    UnknownName
        No such drive moves.
    """
    from regressors.friction.friction_drives import drive_numbers

    numbers = drive_numbers(robot)
    chosen = _chosen(wanted, numbers)
    left = tuple(number for name, number in numbers.items() if number in chosen and not _known(name, curves))
    if len(left) == len(numbers) or not left:
        return bool(left)
    return left


def names_without_curve(
    wanted: bool | Sequence[str], robot: Robot, curves: FrictionCurves | None
) -> bool | tuple[str, ...]:
    """The drives with columns by name: what a task without the curves has to ask for.

    Parameters
    ----------
    wanted, robot, curves
        See `drives_with_columns`.
    """
    left = drives_with_columns(wanted, robot, curves)
    if isinstance(left, bool):
        return left
    from regressors.friction.friction_drives import drive_numbers

    return tuple(name for name, number in drive_numbers(robot).items() if number in left)


def _chosen(wanted: bool | Sequence[str], numbers: dict[str, int]) -> tuple[int, ...]:
    if isinstance(wanted, bool):
        return tuple(numbers.values()) if wanted else ()
    return tuple(_number(name, numbers) for name in wanted)


def _number(name: str, numbers: dict[str, int]) -> int:
    if name in numbers:
        return numbers[name]
    if name.isdecimal() and int(name) in numbers.values():
        return int(name)
    raise UnknownName("drive", name, (f"{number} ({known})" for known, number in numbers.items()))


def _known(name: str, curves: FrictionCurves | None) -> bool:
    return curves is not None and curves.curve(name) is not None
