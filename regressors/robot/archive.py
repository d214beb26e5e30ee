"""A robot back from the plain description that result files carry, so that a file suffices to judge it again."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from regressors.errors import InputError
from regressors.robot.closures import Closure
from regressors.robot.gears import BallScrew, ConstantRatio, GearFunction
from regressors.robot.robot import Aggregates, Branch, Drive, Joint, Limits, Link, Robot, Structure, Transmission
from regressors.robot.shapes import Part

_GEARS: dict[str, type[GearFunction]] = {"ConstantRatio": ConstantRatio, "BallScrew": BallScrew}


@np.errstate(over="ignore", invalid="ignore")  # absurd sizes are refused, without a warning
def robot_from_description(plain: Mapping[str, Any]) -> Robot:
    """Inverse of `Robot.description`."""
    try:
        transmission = plain["transmission"]
        structure = plain["structure"]
        return Robot(
            name=plain["name"],
            joints=tuple(Joint(**joint) for joint in plain["joints"]),
            links=tuple(Link(**link) for link in plain["links"]),
            limits=_limits(plain["limits"]),
            transmission=None if transmission is None else _transmission(transmission),
            gravity=np.array(plain["gravity"], dtype=float),
            structure=Structure(
                frozenset(structure["zero"]),
                tuple(tuple(group) for group in structure["equal"]),
                tuple(Aggregates(tuple(a["joints"]), a["parameters"]) for a in structure["aggregates"]),
            ),
            constants=plain["constants"],
            source=plain["source"],
            branches=tuple(_branch(branch) for branch in plain.get("branches", [])),
            home=None if plain.get("home") is None else np.array(plain["home"], dtype=float),
            shapes=tuple(Part.from_dict(part) for part in plain.get("shapes", [])),
            parents=tuple(plain.get("parents", [])),
            closures=tuple(map(Closure.from_dict, plain.get("closures", []))),
            passive=tuple(plain.get("passive", [])),
            base_joints=tuple(plain.get("base_joints", [])),
        )
    except InputError:
        raise
    except KeyError as error:
        raise InputError(f"not a robot description: {error} is missing") from error
    except (ArithmeticError, AttributeError, TypeError, ValueError) as error:
        raise InputError(f"not a robot description: {error}") from error


def _limits(plain: Mapping[str, Any]) -> Limits:
    return Limits(**{name: np.array([float(v) for v in values]) for name, values in plain.items()})


def _branch(plain: Mapping[str, Any]) -> Branch:
    return Branch(**{**plain, "joint": Joint(**plain["joint"]), "link": Link(**plain["link"])})


def _transmission(plain: Mapping[str, Any]) -> Transmission:
    gears = (_GEARS[drive["ratio"]["type"]](**_untyped(drive["ratio"])) for drive in plain["drives"])
    drives = tuple(Drive(**{**_untyped(drive), "ratio": g}) for drive, g in zip(plain["drives"], gears, strict=True))
    return Transmission(np.array(plain["coupling"]), drives, _limits(plain["limits"]), np.array(plain["offset"]))


def _untyped(plain: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in plain.items() if name != "type"}
