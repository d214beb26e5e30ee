"""Drives that an optional friction parameter is for: all, none, or some by name or number; known ones have none."""

from __future__ import annotations

from typing import TYPE_CHECKING

from regressors.errors import UnknownName

if TYPE_CHECKING:  # modules that describe options must import quickly
    from regressors.friction.curves import FrictionCurves
    from regressors.robot.robot import Robot

DriveChoice = bool | tuple[str, ...]


def drive_numbers(robot: Robot) -> dict[str, int]:
    """Number of every drive, moving or locked, by its name and by its number as text."""
    if robot.transmission is None:
        named = dict(zip(robot.joint_names, robot.link_numbers, strict=True))
    else:
        named = {drive.name: k for k, drive in enumerate(robot.transmission.drives, 1)}
    return {**{str(number): number for number in named.values()}, **named}


def numbers_of(chosen: DriveChoice, robot: Robot, curves: FrictionCurves | None = None) -> bool | tuple[int, ...]:
    """Numbers of chosen drives, without those that a form of the robot does not have, such as behind locked joints."""
    left = without_curve(chosen, robot, curves)
    if isinstance(left, bool):
        return left
    known = drive_numbers(robot)
    return tuple(known[name] for name in left if name in known)


def without_curve(chosen: DriveChoice, robot: Robot, curves: FrictionCurves | None) -> DriveChoice:
    """A choice without the drives whose friction is known: what a task without the curves has to ask for."""
    if curves is None or chosen is False:
        return chosen
    from regressors.friction.load_share import moving_drive_numbers

    moving = moving_drive_numbers(robot)
    known = {number for name, number in moving.items() if curves.curve(name) is not None}
    if not known:
        return chosen
    if chosen is True:
        return tuple(name for name, number in moving.items() if number not in known) or False
    numbers = drive_numbers(robot)
    return tuple(name for name in chosen if numbers.get(name) not in known) or False


def check_choice(chosen: DriveChoice, robot: Robot) -> None:
    """Raise `UnknownName` if a choice names a drive that the whole robot does not have."""
    known = drive_numbers(robot)
    for name in () if isinstance(chosen, bool) else chosen:
        if name not in known:
            numbered = (f"{number} ({drive})" for drive, number in known.items() if drive != str(number))
            raise UnknownName("drive", name, numbered)
