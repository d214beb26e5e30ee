"""Drives that an optional friction parameter is for: all, none, or some by name or number."""

from __future__ import annotations

from typing import TYPE_CHECKING

from regressors.errors import UnknownName

if TYPE_CHECKING:  # modules that describe options must import quickly
    from regressors.robot.robot import Robot

DriveChoice = bool | tuple[str, ...]


def drive_numbers(robot: Robot) -> dict[str, int]:
    """Number of every drive, moving or locked, by its name and by its number as text.

    Parameters
    ----------
    robot : Robot
        Without a transmission each joint is a drive of its own.
    """
    if robot.transmission is None:
        named = dict(zip(robot.joint_names, robot.link_numbers, strict=True))
    else:
        named = {drive.name: k for k, drive in enumerate(robot.transmission.drives, 1)}
    return {**{str(number): number for number in named.values()}, **named}


def numbers_of(chosen: DriveChoice, robot: Robot) -> bool | tuple[int, ...]:
    """Numbers of chosen drives, without those that a form of the robot does not have, such as behind locked joints.

    Parameters
    ----------
    chosen : bool or tuple of str
    robot : Robot
    """
    if isinstance(chosen, bool):
        return chosen
    known = drive_numbers(robot)
    return tuple(known[name] for name in chosen if name in known)


def check_choice(chosen: DriveChoice, robot: Robot) -> None:
    """Raise `UnknownName` if a choice names a drive that the whole robot does not have.

    Parameters
    ----------
    chosen : bool or tuple of str
    robot : Robot
    """
    known = drive_numbers(robot)
    for name in () if isinstance(chosen, bool) else chosen:
        if name not in known:
            numbered = (f"{number} ({drive})" for drive, number in known.items() if drive != str(number))
            raise UnknownName("drive", name, numbered)
