"""The first three axes of the IRp-6 in Pinocchio, from the numbers of its description and nothing else of excite.

The 13 parameters are those of Kozlowski and Dutkiewicz (1996): seven aggregates X = A theta of the symmetric links,
then Coulomb and viscous friction of every drive. Drives move z = C q, so that ``tau_q = C' tau_z``.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin  # type: ignore[import-untyped]
from numpy.typing import NDArray
from ruamel.yaml import YAML

Array = NDArray[np.float64]

ROBOTS = Path(__file__).resolve().parents[2] / "regressors" / "robots"
AXES = 3
_TENSOR = ("xx", "xy", "yy", "xz", "yz", "zz")
_NAMES = ("m{0}", "m{0}c{0}x", "m{0}c{0}y", "m{0}c{0}z", *(f"I{{0}}{a}" for a in _TENSOR))  # Pinocchio's order


@cache
def description(robot: str = "irp6") -> Any:
    """The file of a robot as plain data."""
    return YAML(typ="safe").load((ROBOTS / f"{robot}.yaml").read_text(encoding="utf-8"))


def _radians(value: float | str) -> float:
    return np.deg2rad(float(value.removesuffix("deg"))) if isinstance(value, str) else float(value)


def placement(joint: Any) -> Any:
    """Frame of a joint at zero in that before it, by modified Denavit-Hartenberg parameters."""
    alpha, a, d, offset = (_radians(joint["mdh"].get(key, 0.0)) for key in ("alpha", "a", "d", "offset"))
    twist = pin.SE3(pin.utils.rotate("x", alpha), np.array([a, 0.0, 0.0]))
    return twist * pin.SE3(pin.utils.rotate("z", offset), np.array([0.0, 0.0, d]))


@cache
def model() -> tuple[Any, Any]:
    """Pinocchio's model of three axes, the wrist held at zero, in modified Denavit-Hartenberg frames."""
    arm, parent, held = pin.Model(), 0, pin.SE3.Identity()
    for k, (joint, link) in enumerate(zip(description()["joints"], description()["links"], strict=True)):
        place = placement(joint)
        if k < AXES:
            parent = arm.addJoint(parent, pin.JointModelRZ(), place, f"q{k + 1}")
        else:
            held = held * place
        tensor = [link["inertia"].get(axes, 0.0) for axes in _TENSOR]
        body = pin.Inertia.FromDynamicParameters(np.array([link["mass"], *link["first_moment"], *tensor]))
        arm.appendBodyToJoint(parent, body, held)
    gravity = arm.gravity
    gravity.linear = np.array([0.0, 0.0, -description()["gravity"]])
    arm.gravity = gravity
    return arm, arm.createData()


def coupling() -> Array:
    """C of z = C q, shape (3, 3)."""
    return np.array(description()["coupling"], dtype=float)[:AXES, :AXES]


def _coefficient(text: float | str) -> float:
    """A number, a constant, or the square of one."""
    if not isinstance(text, str):
        return float(text)
    name, _, power = text.partition("^")
    return float(description()["constants"][name]) ** int(power or 1)


@cache
def aggregates() -> tuple[tuple[str, ...], Array, Array]:
    """Names of the aggregates, A over the links' parameters, shape (7, 30), and what the rotors add, shape (7,)."""
    standard = [name.format(link) for link in range(1, AXES + 1) for name in _NAMES]
    table = description()["structure"]["aggregates"][0]["parameters"]
    A, rotors = np.zeros((len(table), len(standard))), np.zeros(len(table))
    for row, terms in enumerate(table.values()):
        for name, text in terms.items():
            if rotor := re.fullmatch(r"Ia(\d)", name):
                rotors[row] += _coefficient(text) * description()["drives"][int(rotor[1]) - 1]["rotor_inertia"]
            else:
                A[row, standard.index(name)] = _coefficient(text)
    return tuple(table), A, rotors


def regressor(q: Array, dq: Array, ddq: Array) -> Array:
    """Stacked W of the joints' torques, instant by instant, shape (3 N, 13).

    The columns Y of the links' parameters that do not vanish by symmetry are Y = W A; W = Y A^+ then.
    """
    arm, data = model()
    C, A = coupling(), aggregates()[1]
    to_aggregates = np.linalg.pinv(A)
    blocks = []
    for state in zip(q, dq, ddq, strict=True):
        speed = C @ state[1]
        Y = pin.computeJointTorqueRegressor(arm, data, *state)
        blocks.append(np.hstack([Y @ to_aggregates, C.T * np.sign(speed), C.T * speed]))
    return np.concatenate(blocks)


def parameters() -> tuple[list[str], Array]:
    """Names of the 13 columns, and their described values."""
    names, A, rotors = aggregates()
    theta = np.concatenate([inertia.toDynamicParameters() for inertia in model()[0].inertias[1:]])
    friction = [drive["friction"] for drive in description()["drives"][:AXES]]
    values = [A @ theta + rotors, [each["coulomb"] for each in friction], [each["viscous"] for each in friction]]
    labels = [*names, *(f"F{k + 1}{kind}" for kind in "cv" for k in range(AXES))]
    return labels, np.concatenate(values)
