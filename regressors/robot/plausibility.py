"""Numbers of a description that no robot has, and inertial parameters that no body has or that were never measured."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from regressors.errors import InputError
from regressors.quantities import fault
from regressors.robot.gears import ConstantRatio
from regressors.robot.inertia import Array, inertia_tensor, skew
from regressors.robot.robot import LIMITED, Limits, Link, Robot, transmission_of

_ROUNDING = 1e-3  # of the largest moment: descriptions print three digits or more
_FEWEST_ALIKE = 3


def undescribed(robot: Robot) -> list[str]:
    """Names of the bodies whose inertial parameters are unknown."""
    return [body.name for body in robot.bodies if body.theta is None]


def described_bodies(robot: Robot, why: str) -> Array:
    """Parameters of all bodies as described, shape (b, 10); raise `InputError` with the reason where one is unknown."""
    if unknown := undescribed(robot):
        raise InputError(
            f"robot {robot.name!r}: the inertia of link {', '.join(unknown)} is unknown, {why}; state mass, "
            "first_moment and inertia in the robot's file"
        )
    return np.array([body.theta for body in robot.bodies])


def implausible_inertias(robot: Robot) -> dict[str, str]:
    """Reason why the inertial parameters of a body cannot be relied on, by the body's name.

    A body is impossible if its mass is negative, or if its principal moments of inertia ``J1 <= J2 <= J3`` about the
    centre of mass break ``J1 >= 0`` or ``J1 + J2 >= J3``. Parameters are placeholders if three or more bodies of one
    limb share mass and moments, and zero if no body of the robot has mass.
    """
    known = [body for body in robot.bodies if body.theta is not None]
    reasons = dict.fromkeys(undescribed(robot), "no mass is stated")
    if known and not any(np.any(body.theta) for body in known):
        return reasons | {body.name: "the mass is zero" for body in known}
    reasons |= {body.name: reason for body in known if (reason := _impossible(body)) is not None}
    return reasons | dict.fromkeys(_placeholders(robot, known), "mass and inertia equal those of other links")


def _impossible(body: Link) -> str | None:
    assert body.theta is not None
    if body.theta[0] < 0:
        return f"the mass is negative, {body.theta[0]:g} kg"
    low, middle, high = moments = principal_moments(body.theta)
    tolerance = _ROUNDING * float(np.abs(moments).max())
    if low < -tolerance:
        return f"a principal moment of inertia is negative, {low:.3g} kg m^2"
    if high > low + middle + tolerance:
        return f"principal moments of inertia {low:.3g}, {middle:.3g}, {high:.3g} kg m^2 break the triangle inequality"
    return None


def principal_moments(theta: Array) -> Array:
    """Eigenvalues of ``I_O + m skew(c) skew(c)``, about the centre of mass, ascending; NaN if not finite [kg m^2]."""
    # theta (10,)
    tensor, mass = inertia_tensor(theta), float(theta[0])
    if mass != 0:
        first = skew(theta[1:4])
        tensor = tensor + first @ first / mass
    return np.asarray(np.linalg.eigvalsh(tensor)) if np.all(np.isfinite(tensor)) else np.full(3, np.nan)


def _placeholders(robot: Robot, bodies: Sequence[Link]) -> Iterator[str]:
    """Names of bodies that share mass and moments with two others of a limb or more; massless ones do not count."""
    shared: dict[tuple[float, ...], list[str]] = {}
    for body in bodies:
        if body.theta is not None and body.theta[0] > 0:
            key = (float(body.theta[0]), *np.round(principal_moments(body.theta), 9).tolist())
            shared.setdefault(key, []).append(body.name)
    for names in shared.values():
        if any(len(limb.intersection(names)) >= _FEWEST_ALIKE for limb in robot.limbs):
            yield from names


def check_sizes(robot: Robot, source: str) -> None:
    """Raise `InputError` for the first number of a description that no robot has."""
    for what, quantity, value in _numbers(robot):
        if (wrong := fault(quantity, value)) is not None:
            raise InputError(f"{source}: {what} {wrong}")


def _numbers(robot: Robot) -> list[tuple[str, str, object]]:
    """Name, quantity and value of every number."""
    joints = [*robot.joints, *(branch.joint for branch in robot.branches)]
    numbers: list[tuple[str, str, object]] = [("gravity", "gravity", robot.gravity.tolist())]
    numbers += [(f"joint {joint.name}: translation", "length", joint.translation.tolist()) for joint in joints]
    known = [(link.name, link.theta) for link in robot.bodies if link.theta is not None]
    numbers += [(f"link {name}: inertial parameters", "moment", theta.tolist()) for name, theta in known]
    numbers += _of_limits("joints", robot.limits)
    transmission = transmission_of(robot)
    numbers += _of_limits("drives", transmission.limits)
    numbers.append(("coupling", "ratio", transmission.coupling.tolist()))
    for drive in transmission.drives:
        ratio = drive.ratio.value if isinstance(drive.ratio, ConstantRatio) else None
        numbers.append((f"drive {drive.name}: ratio", "ratio", ratio))
        numbers.append((f"drive {drive.name}: rotor inertia", "moment", drive.rotor_inertia))
        numbers.append((f"drive {drive.name}: friction", "friction_parameter", [drive.coulomb, drive.viscous]))
    return numbers


def _of_limits(what: str, limits: Limits) -> list[tuple[str, str, object]]:
    bounds = [(name, getattr(limits, name)) for name in LIMITED if name != "position"]
    named = [("lower position", -limits.lower), ("upper position", limits.upper), *bounds]
    return [(f"limits of {what}: {name}", "bound", value.tolist()) for name, value in named]
