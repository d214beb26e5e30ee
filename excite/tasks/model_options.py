"""Options of a model: which drives an optional friction parameter is for, and what a model object was made with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from excite.registry import BUILT_IN, place_of
from regressors.errors import UnknownName

if TYPE_CHECKING:  # modules that describe options must import quickly
    from regressors.models.load import Sensor
    from regressors.robot.columns import Drives, Terms
    from regressors.robot.friction.curves import FrictionCurves
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
    """A choice without the drives whose friction is known: what a task without the curves has to ask for.

    All drives are those that drive: passive joints have no friction, unless they are named.
    """
    if chosen is False or (curves is None and not robot.passive):
        return chosen
    from regressors.robot.friction.load_and_temperature import drives_with_friction, moving_drive_numbers

    if chosen is True and robot.passive:
        driven = [name not in robot.passive for name in robot.joint_names]
        chosen = tuple(name for name, row in drives_with_friction(robot) if row[driven].any())
    if curves is None:
        return chosen
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


FURTHER_TERMS = {
    "offset": "offset",
    "load_share": "load_share",
    "root": "root_friction",
    "asymmetry": "asymmetric_friction",
    "stribeck": "stribeck",
}


def options_of_model(model: Any) -> dict[str, Any] | None:
    """Fields of a `ModelChoice` by name, with which the model's name alone builds the same model."""
    if place_of(model) not in BUILT_IN["model"].values():
        return None
    options: dict[str, Any] = {}
    for name, value in dict(model.options).items():
        said = _OPTIONS[name](value) if name in _OPTIONS else None
        if said is None:
            return None
        options |= said
    return options


def _of_terms(terms: Terms) -> Mapping[str, Any] | None:
    if terms.coulomb != terms.viscous:
        return None
    return {
        "friction": _drives(terms.coulomb),
        "rotor": terms.rotor,
        "reflected_rotors": terms.reflected,
        "stribeck_speed": terms.stribeck_speed,
        **{option: _drives(getattr(terms, name)) for name, option in FURTHER_TERMS.items()},
    }


def _drives(chosen: Drives) -> bool | tuple[str, ...]:
    return chosen if isinstance(chosen, bool) else tuple(map(str, chosen))


def _of_sensor(sensor: Sensor) -> Mapping[str, Any]:
    from scipy.spatial.transform import Rotation

    angles = Rotation.from_matrix(sensor.rotation).as_euler("xyz")
    return {
        "sensor": sensor.link,
        "sensor_xyz": tuple(float(x) for x in sensor.translation),
        "sensor_rpy": tuple(float(angle) for angle in angles),
        "equations": tuple(sensor.equations),
    }


_OPTIONS: dict[str, Any] = {
    "terms": _of_terms,
    "window": lambda w: None if w.step is not None else {"window": w.kind, "window_length": w.length},
    "sensor": _of_sensor,
    "sign_width": lambda width: {} if width == 0.0 else None,
    "carried": lambda carried: {"carried": dict(carried)},
}
