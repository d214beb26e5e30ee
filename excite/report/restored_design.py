"""A design read from its folder, with everything that its figures and its player show."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
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
from excite.files.design_folder import STARTS, TRAJECTORY
from excite.files.sampled_motion import read_motion
from excite.files.stored import complete
from excite.files.world_file import world_of
from excite.information.metrics import PredictedAccuracy
from excite.information.target import IdentificationTarget, target_of
from excite.simulation.reference import SampledMotion
from excite.trajectories.sequence import EXCITE, Motion, MotionSequence, Piece
from regressors.models.motor_side import MotorSide
from regressors.samples import Array, Samples


@dataclass(frozen=True, eq=False)
class Stretch:
    """Part of a longer motion.

    Parameters
    ----------
    whole : SampledMotion
    begin, end : float
        [s]
    """

    whole: SampledMotion
    begin: float
    end: float

    @property
    def duration(self) -> float:
        """Duration from start to end [s]."""
        return self.end - self.begin

    def samples(self, time: Array) -> Samples:
        """Motion at given instants between 0 and the duration [s]."""
        part = self.whole.samples(np.clip(self.begin + time, 0.0, self.whole.duration))
        return Samples(time, part.q, part.dq, part.ddq, part.dddq)


@dataclass(frozen=True, eq=False)
class WrittenTransfers(ApproachAndReturn):
    """Approach and return as they are in ``trajectory.csv``.

    Parameters
    ----------
    whole : SampledMotion
        Motion of every joint, from home to home.
    spans : mapping of str to (float, float)
        Start and end of each segment [s].
    """

    whole: SampledMotion | None = None
    spans: Mapping[str, tuple[float, float]] | None = None

    def sequence(self, motion: Motion, steps: int) -> MotionSequence:
        """The approach, a motion, and the return; see `ApproachAndReturn.sequence`."""
        if self.whole is None or self.spans is None:
            return super().sequence(motion, steps)
        pieces = []
        for name, (begin, end) in self.spans.items():
            part: Motion = motion if name == EXCITE else Stretch(self.whole, begin, end)
            pieces.append(Piece(name, part, steps if name == EXCITE else round((end - begin) * self.rate)))
        return MotionSequence(tuple(pieces))


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
    return target.model.assemble(stored.trajectory.samples(times)).shape[0]


def _starts(folder: Path) -> tuple[StartResult, ...]:
    """Results of the starts, where the folder still has them."""
    return tuple(read_start(path)[0] for _, path in start_files(folder)) if folder.is_dir() else ()


def _transfers(stored: StoredDesign) -> WrittenTransfers | None:
    """Approach and return from the file that plays them."""
    played = stored.content["played"]
    spans = {each["name"]: (each["start"], each["end"]) for each in played["segments"]}
    if len(spans) == 1:
        return None
    limits = {name: tuple(limit_use(use) for use in played[name]["limits"]) for name in spans if name in played}
    whole = read_motion(stored.folder / TRAJECTORY, stored.robot.joint_names)
    return WrittenTransfers(None, None, 0, played["rate"], limits, whole, spans)
