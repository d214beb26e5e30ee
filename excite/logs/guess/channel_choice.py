"""Which of several groups of columns are the channels of a log, and whose joints they are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from excite.logs.guess.channel_group import ChannelGroup
from regressors.robot.robot import Robot

_SHOWN = 4


@dataclass(frozen=True)
class ChosenChannels:
    """Channels of a log."""

    groups: Mapping[str, ChannelGroup]  # by quantity
    names: tuple[str, ...] | None  # of the joints; None for those of the robot, in order
    # what the names leave open, with the quantity that it is about; empty for the whole
    questions: tuple[tuple[str, str], ...]


def chosen_channels(groups: Sequence[ChannelGroup], robot: Robot | None) -> ChosenChannels:
    """The likeliest channels."""
    questions: list[tuple[str, str]] = []
    candidates = [_of_robot(group, robot) for group in groups if group.quantity == "position" and group.measured]
    if not candidates:
        return ChosenChannels({}, None, ())
    fitting = [group for group in candidates if robot is None or len(group.joints) == robot.n] or candidates
    best = max(fitting, key=lambda group: group.rank)
    if others := [group for group in fitting if group is not best and group.rank == best.rank]:
        listed = " or ".join(group.span for group in [best, *others][:_SHOWN])
        questions.append(("position", f"Which are the measured positions of the joints: {listed}?"))
    names, asked = _names(best, robot)
    questions += [("", question) for question in asked]
    chosen = {"position": best}
    for quantity in ("velocity", "effort", "current", "temperature"):
        if quantity == "current" and "effort" in chosen:
            continue
        if (group := _beside(groups, quantity, best)) is not None:
            chosen[quantity] = group
    questions += _efforts(groups, chosen, best)
    wrenches = [group for group in groups if group.quantity == "wrench"]
    if wrenches:
        chosen["wrench"] = max(wrenches, key=lambda group: group.rank)
        questions += _wrench(wrenches, chosen["wrench"])
    return ChosenChannels(chosen, names, tuple(questions))


def _plain(name: str) -> str:
    return "".join(character for character in name.lower() if character.isalnum())


def _of_robot(group: ChannelGroup, robot: Robot | None) -> ChannelGroup:
    """The group limited to the joints of a robot, in their order, where it names all of them."""
    if robot is None:
        return group
    known = {_plain(name): name for name in group.joints}
    if len(known) == len(group.joints) and all(_plain(name) in known for name in robot.joint_names):
        return group.of([known[_plain(name)] for name in robot.joint_names])
    return group


def _names(group: ChannelGroup, robot: Robot | None) -> tuple[tuple[str, ...] | None, list[str]]:
    numbers = all(not joint or joint.isdigit() for joint in group.joints)
    if robot is None:
        return (None if numbers else group.joints), []
    if [_plain(name) for name in group.joints] == [_plain(name) for name in robot.joint_names]:
        return robot.joint_names, []
    if len(group.joints) != robot.n:
        names = ", ".join(robot.joint_names)
        return None, [
            f"Which of the {len(group.joints)} joints of the recording ({_some(group.joints)}) are those of "
            f"{robot.name} ({names})? Give the columns of these only"
        ]
    if numbers:
        return None, []
    return robot.joint_names, [
        f"Are the joints {_some(group.joints)} of the recording, in this order, {', '.join(robot.joint_names)} of "
        f"{robot.name}?"
    ]


def _some(names: Sequence[str]) -> str:
    return ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")


def _beside(groups: Sequence[ChannelGroup], quantity: str, position: ChannelGroup) -> ChannelGroup | None:
    """Group of a quantity of the same joints."""
    fitting = [
        group
        for group in groups
        if group.quantity == quantity and group.measured and set(position.joints) <= set(group.joints)
    ]
    if not fitting:
        return None
    words = set(position.common)
    nearest = max(
        fitting, key=lambda group: (group.stream == position.stream, len(words.intersection(group.common)), group.rank)
    )
    return nearest.of(position.joints)


def _efforts(
    groups: Sequence[ChannelGroup], chosen: dict[str, ChannelGroup], position: ChannelGroup
) -> list[tuple[str, str]]:
    """What is to be asked of efforts and currents; the likeliest columns where no name says so."""
    if "effort" in chosen:
        effort = chosen["effort"]
        if effort.why or effort.unit:
            return []
        why = f"The efforts ({effort.span}) may be joint torques [Nm], motor torques [Nm] or motor currents [A]"
        return [("effort", f"{why}: the file does not say; edit effort, or make it current with a gain [Nm/A]")]
    if "current" in chosen:
        return [
            (
                "current",
                f"What is the gain of each motor current ({chosen['current'].span}), joint torque per current "
                "[Nm/A]? The gain 1 stands for it",
            )
        ]
    used = {column for group in chosen.values() for column in group.columns}
    others = [
        group
        for group in groups
        if not group.quantity and len(group.columns) == len(position.columns) and not used.intersection(group.columns)
    ]
    if not others:
        return [("effort", "The recording holds no efforts that were recognised: add effort or current, if it has any")]
    first = others[0]
    chosen["effort"] = replace(first, quantity="effort", joints=position.joints, guessed=True)
    listed = ", or ".join(group.span for group in others[:_SHOWN])
    return [
        (
            "effort",
            f"Which columns are the efforts of the joints ({listed}), and are they joint torques [Nm], motor torques "
            "[Nm] or motor currents [A]? The file does not say; edit effort, or make it current with a gain [Nm/A]",
        )
    ]


def _wrench(wrenches: Sequence[ChannelGroup], chosen: ChannelGroup) -> list[tuple[str, str]]:
    questions = []
    if len(wrenches) > 1:
        listed = " or ".join(group.span for group in wrenches[:_SHOWN])
        questions.append(("wrench", f"Which is the wrench of the sensor: {listed}?"))
    if not chosen.why and not chosen.unit:
        questions.append(("wrench", f"Is the wrench {chosen.span} in N and Nm, in the frame of the sensor?"))
    return questions
