"""A design read from its folder, with everything that its figures and its player show."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from constraints.bounds.certificate import LimitUse
from excite.design.approach import ApproachAndReturn
from excite.design.design import Design
from excite.design.imposed_limits import nonlinear_limits
from excite.design.start_results import StartResult, read_start, start_files
from excite.design.stated_limits import stated_limits
from excite.design.stored_design import StoredDesign
from excite.files.design_folder import STARTS
from excite.files.stored import complete
from excite.files.world_file import world_of
from excite.information.metrics import PredictedAccuracy
from excite.information.target import IdentificationTarget, target_of
from excite.trajectories.scurve import SCurve
from excite.trajectories.sequence import APPROACH, RETURN
from excite.trajectories.transfer import Leg, Transfer
from regressors.models.motor_side import MotorSide


def restore(stored: StoredDesign) -> Design:
    """The design that a folder holds, with its limits as functions of the motion.

    Parameters
    ----------
    stored : StoredDesign

    Raises
    ------
    InputError
        A user-defined part or a file that the design only names, or entries that are missing.
    """
    content, task = stored.content, stored.task
    target = target_of(stored.robot, task)
    joints = target.robot.joint_names
    with complete(stored.folder / "design.json", "design"):
        shape = None if content.get("shape") is None else world_of(content["shape"], "the shape of the design")
        stated = stated_limits(stored.robot, joints, task, shape)
        return Design(
            robot=stored.robot,
            task=task,
            target=target,
            trajectory=stored.trajectory,
            criteria={name: math.inf if value is None else value for name, value in content["criteria"].items()},
            limits=tuple(limit_use(use) for use in content["limits"]),
            predicted=tuple(_accuracy(each) for each in content["predicted"]["parameters"]),
            spectrum=np.array(content["base"]["singular_values"]),
            rows=_rows(target, stored),
            starts=_starts(stored.folder / STARTS),
            best_start=content["solver"]["best_start"],
            provenance=dict(stored.provenance),
            notes=tuple(content["notes"]),
            interrupted=content["interrupted"],
            approach_and_return=_transfers(stored),
            folder=stored.folder,
            nonlinear=(*nonlinear_limits(stored.robot, joints, task), *stated.constraints),
            unchecked=stored.unchecked,
            shape=shape,
        )


def limit_use(content: Mapping[str, Any]) -> LimitUse:
    """A limit's certificate as a file has it."""
    return LimitUse(**{name: value for name, value in content.items() if name != "holds"})


def _accuracy(content: Mapping[str, Any]) -> PredictedAccuracy:
    side = content.get("motor_side")
    known = {name: value for name, value in content.items() if name != "motor_side"}
    if side is None:
        return PredictedAccuracy(**known)
    motor = MotorSide(**{name: value for name, value in side.items() if name != "standard_deviation"})
    return PredictedAccuracy(**known, motor_side=motor)


def _rows(target: IdentificationTarget, stored: StoredDesign) -> int:
    times = target.model.times(stored.trajectory.duration, stored.task.output.rate)
    return int(target.model.assemble(stored.trajectory.samples(times)).shape[0])


def _starts(folder: Path) -> tuple[StartResult, ...]:
    """Results of the starts, where the folder still has them."""
    return tuple(read_start(path)[0] for _, path in start_files(folder)) if folder.is_dir() else ()


def _transfers(stored: StoredDesign) -> ApproachAndReturn | None:
    """Approach and return, from the lines and laws of motion that the file has."""
    if stored.task.output.home is None:
        return None
    played = stored.content["played"]
    written = {name: played[name] for name in (APPROACH, RETURN) if name in played}
    limits = {name: tuple(limit_use(use) for use in entry["limits"]) for name, entry in written.items()}
    transfers = {name: _transfer(entry) for name, entry in written.items()}
    spans = {each["name"]: each["end"] - each["start"] for each in played["segments"]}
    rests = [round((spans[name] - transfer.duration) * played["rate"]) for name, transfer in transfers.items()]
    return ApproachAndReturn(
        transfers.get(APPROACH), transfers.get(RETURN), max(rests, default=0), played["rate"], limits
    )


def _transfer(content: Mapping[str, Any]) -> Transfer:
    legs = tuple(
        Leg(np.array(leg["start"]), np.array(leg["end"]), law_of_jerks(leg["breaks"], leg["jerk"]))
        for leg in content["legs"]
    )
    return Transfer(legs, content["shortest"], {"acceleration": (), "jerk": ()})


def law_of_jerks(breaks: Sequence[float], jerks: Sequence[float]) -> SCurve:
    """The law from rest at 0 whose jerk is constant between breaks.

    Parameters
    ----------
    breaks : sequence of float, length m + 1
        [s]
    jerks : sequence of float, length m
        [1/s^3]
    """
    pieces, s, ds, dds = [], 0.0, 0.0, 0.0
    for h, j in zip(np.diff(breaks), jerks, strict=True):
        pieces.append([j / 6, dds / 2, ds, s])
        s, ds, dds = s + h * (ds + h * (dds / 2 + h * j / 6)), ds + h * (dds + h * j / 2), dds + h * j
    return SCurve(np.array(breaks), np.array(pieces).T)
