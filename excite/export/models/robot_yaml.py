"""Robots, and ranges of their parameters, as YAML."""

from __future__ import annotations

import io
import json
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml import YAML

from excite.storage.result_folder import write_file
from excite.study.posterior_samples import ParameterRange, PosteriorSamples
from regressors.errors import InputError
from regressors.readers.description import parse_description
from regressors.readers.documents import yaml_float
from regressors.robot.gears import BallScrew, ConstantRatio, GearFunction
from regressors.robot.robot import BASE, Branch, Drive, Joint, Limits, Link, Robot, Transmission

_quoted = partial(json.dumps, ensure_ascii=False)
_HEAD = "# metres, kilograms, seconds, radians; inertial parameters about the origin of each link's frame\n"


def write_robot(robot: Robot, path: str | Path, *, replace: bool = False) -> None:
    """Write a robot as robot YAML."""
    path = Path(path)
    if path.suffix.lower() not in (".yaml", ".yml"):
        raise InputError(f"{str(path)!r}: a robot YAML ends in .yaml or .yml")
    write_file(path, robot_text(robot).encode("utf-8"), replace=replace)


def robot_text(robot: Robot) -> str:
    """Robot YAML of a robot."""
    if robot.base_joints:
        raise InputError(
            f"robot YAML cannot hold robot {robot.name!r}, whose base moves; choose mjcf, urdf, npz, csv, md or tex"
        )
    stream = io.StringIO()
    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style, yaml.width = None, 110
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    yaml.dump(_content(robot), stream)
    text = _HEAD + stream.getvalue()
    if parse_description(text, f"robot YAML of {robot.name}").sha256() != robot.sha256():
        raise InputError(
            f"robot YAML cannot hold all of robot {robot.name!r}: joints of it are locked, or the inertia of a rotor "
            "is not known; write the whole robot as it was read"
        )
    return text


def _content(robot: Robot) -> dict[str, Any]:
    structure = robot.structure
    aggregates = [
        {"joints": list(a.joints), "parameters": {name: dict(terms) for name, terms in a.parameters.items()}}
        for a in structure.aggregates
    ]
    equal = [list(group) for group in structure.equal]
    content = {
        "name": robot.name,
        "source": robot.source,
        "gravity": robot.gravity.tolist(),
        "constants": dict(robot.constants),
        "joints": [
            {"name": joint.name, **_carried(robot, k), **_placed(joint), "limits": _limits(robot.limits, k)}
            for k, joint in enumerate(robot.joints)
        ],
        "links": [_link(link) for link in robot.links],
        "branches": [_branch(branch) for branch in robot.branches],
        **_transmission(robot.transmission),
        "structure": _filled({"zero": sorted(structure.zero), "equal": equal, "aggregates": aggregates}),
        "home": None if robot.home is None else robot.home.tolist(),
        "shapes": [part.to_dict() for part in robot.shapes],
        "loops": [_filled(asdict(closure)) for closure in robot.closures],
        "passive": list(robot.passive),
    }
    return _filled(content)


def _filled(fields: dict[str, Any]) -> dict[str, Any]:
    """Without the fields that say nothing."""
    return {name: value for name, value in fields.items() if value not in (None, "", [], {})}


def _carried(robot: Robot, k: int) -> dict[str, str]:
    """The link that carries a joint, where that is not the one before."""
    parent = robot.parents[k]
    return {} if parent == k else {"parent": robot.links[parent - 1].name if parent else BASE}


def _placed(joint: Joint) -> dict[str, Any]:
    pose = {"xyz": joint.translation.tolist(), "matrix": joint.rotation.tolist(), "axis": joint.axis.tolist()}
    return {"kind": joint.kind, "pose": pose}


def _limits(limits: Limits, k: int) -> dict[str, Any]:
    bounds = {name: float(getattr(limits, name)[k]) for name in ("velocity", "acceleration", "jerk", "torque")}
    position = [float(limits.lower[k]), float(limits.upper[k])]
    known = {name: bound for name, bound in bounds.items() if np.isfinite(bound)}
    return {"position": position, **known} if np.all(np.isfinite(position)) else known


def _link(link: Link) -> dict[str, Any]:
    if link.theta is None:
        return {"name": link.name}
    mass, x, y, z, xx, xy, xz, yy, yz, zz = link.theta.tolist()
    inertia = {"about": "origin", "xx": xx, "xy": xy, "xz": xz, "yy": yy, "yz": yz, "zz": zz}
    return {"name": link.name, "mass": mass, "first_moment": [x, y, z], "inertia": inertia}


def _branch(branch: Branch) -> dict[str, Any]:
    return {
        **_link(branch.link),
        "parent": branch.parent,
        "joint": _placed(branch.joint),
        "coupling": branch.coupling.tolist(),
        "offset": branch.offset,
        **({"number": branch.link.number} if branch.link.number else {}),
    }


def _transmission(transmission: Transmission | None) -> dict[str, Any]:
    if transmission is None:
        return {}
    drives = enumerate(zip(transmission.drives, transmission.offset.tolist(), strict=True))
    return {
        "drives": [_drive(drive, offset, _limits(transmission.limits, k)) for k, (drive, offset) in drives],
        "coupling": transmission.coupling.tolist(),
    }


def _drive(drive: Drive, offset: float, limits: dict[str, Any]) -> dict[str, Any]:
    friction = _filled({"coulomb": drive.coulomb, "viscous": drive.viscous})
    motor = {"ratio": _ratio(drive.ratio), "rotor_inertia": drive.rotor_inertia, "friction": friction}
    return _filled({"name": drive.name, **motor, "offset": offset, "limits": limits})


def _ratio(gear: GearFunction) -> Any:
    if isinstance(gear, ConstantRatio):
        return float(gear.value)
    if isinstance(gear, BallScrew):
        return {"ball_screw": {"pitch": gear.pitch, "square": gear.square, "cosine": gear.cosine, "sine": gear.sine}}
    raise InputError(f"robot YAML cannot hold a gear of type {type(gear).__name__}")


def ranges_text(samples: PosteriorSamples, level: float, comment: tuple[str, ...] = ()) -> str:
    """The whole document, the same for the same samples."""
    lines = [
        *(f"# {line}" for line in comment),
        f"robot: {_quoted(samples.robot)}",
        f"result_sha256: {_quoted(samples.result_sha256 or '')}",
        f"level: {yaml_float(level)}",
        f"samples: {len(samples)}",
        f"seed: {samples.seed}",
        f"prior: {yaml_float(samples.prior)}",
        "parameters:",
        *map(_line, samples.ranges(level)),
    ]
    return "".join(f"{line}\n" for line in lines)


def _line(one: ParameterRange) -> str:
    numbers = ", ".join(f"{name}: {yaml_float(getattr(one, name))}" for name in ("low", "high", "mean", "deviation"))
    return f"  {one.name}: {{unit: {_quoted(one.unit)}, {numbers}}}"
