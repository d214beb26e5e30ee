"""Whether every number of a robot's description is of a size that robots have."""

from __future__ import annotations

from regressors.errors import InputError
from regressors.quantities import fault
from regressors.robot.gears import ConstantRatio
from regressors.robot.robot import LIMITED, Limits, Robot


def check_sizes(robot: Robot, source: str) -> None:
    """Raise `InputError` for the first number of a description that no robot has."""
    for what, quantity, value in _numbers(robot):
        if (wrong := fault(quantity, value)) is not None:
            raise InputError(f"{source}: {what} {wrong}")


def _numbers(robot: Robot) -> list[tuple[str, str, object]]:
    """Name, quantity and value of every number."""
    joints = [*robot.joints, *(branch.joint for branch in robot.branches)]
    links = [*robot.links, *(branch.link for branch in robot.branches)]
    numbers: list[tuple[str, str, object]] = [("gravity", "gravity", robot.gravity.tolist())]
    numbers += [(f"joint {joint.name}: translation", "length", joint.translation.tolist()) for joint in joints]
    known = [(link.name, link.theta) for link in links if link.theta is not None]
    numbers += [(f"link {name}: inertial parameters", "moment", theta.tolist()) for name, theta in known]
    numbers += _of_limits("joints", robot.limits)
    if robot.transmission is None:
        return numbers
    numbers += _of_limits("drives", robot.transmission.limits)
    numbers.append(("coupling", "ratio", robot.transmission.coupling.tolist()))
    for drive in robot.transmission.drives:
        ratio = drive.ratio.value if isinstance(drive.ratio, ConstantRatio) else None
        numbers.append((f"drive {drive.name}: ratio", "ratio", ratio))
        numbers.append((f"drive {drive.name}: rotor inertia", "moment", drive.rotor_inertia))
        numbers.append((f"drive {drive.name}: friction", "friction_parameter", [drive.coulomb, drive.viscous]))
    return numbers


def _of_limits(what: str, limits: Limits) -> list[tuple[str, str, object]]:
    bounds = [(name, getattr(limits, name)) for name in LIMITED if name != "position"]
    named = [("lower position", -limits.lower), ("upper position", limits.upper), *bounds]
    return [(f"limits of {what}: {name}", "bound", value.tolist()) for name, value in named]
