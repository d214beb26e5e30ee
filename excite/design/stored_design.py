"""A design read back from its file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from constraints.bounds.certificate import LimitUse
from constraints.collision.geometry import World
from constraints.nonlinear import NonlinearConstraint
from excite.design.approach import ApproachAndReturn
from excite.design.designed_motion import DesignedMotion
from excite.design.motion_limits import RecomputedLimits, imposed_on, recomputed_limits
from excite.design.stated_limits import Unchecked
from excite.information.metrics import MotionMeasures, noise_per_row
from excite.information.target import IdentificationTarget, moving_robot, target_of
from excite.storage.manifest import entry_sha256
from excite.tasks.task import Task
from excite.trajectories import Trajectory
from excite.trajectories.sequence import APPROACH, RETURN
from excite.trajectories.transfer import Leg, SCurve, Transfer
from regressors.errors import InputError
from regressors.robot.robot import Robot
from regressors.samples import Array

_ROUNDING = 1e-9  # of a metric, from process to process


@dataclass(frozen=True, eq=False, repr=False)
class StoredDesign(DesignedMotion):
    """A design read from its folder: the robot, the task and the motion, to be played or judged again.

    Parameters
    ----------
    folder : Path
    robot : Robot
        The whole robot.
    task : Task
    trajectory : Trajectory
    content : dict
        The whole file.
    shape : World or None
        Of the robot, by which self-collision is checked, where the file holds it.
    """

    folder: Path
    robot: Robot
    task: Task
    trajectory: Trajectory
    content: dict[str, Any]
    shape: World | None = None

    @cached_property
    def moving(self) -> Robot:
        """The robot that the model is written for, with the task's limits."""
        return moving_robot(self.robot, self.task)

    @cached_property
    def transfers(self) -> ApproachAndReturn | None:
        """Approach and return, where the file has them."""
        return stored_transfers(self.content["played"]) if "played" in self.content else None

    @cached_property
    def nonlinear(self) -> tuple[NonlinearConstraint, ...]:
        """Limits of torques, the tool and distances, functions of the joints that move.

        Raises
        ------
        InputError
            A part or a file that the task only names.
        """
        return imposed_on(self, self.moving.joint_names)

    @cached_property
    def recomputed(self) -> RecomputedLimits:
        """Limits of the motion, computed from its coefficients."""
        return recomputed_limits(self)

    @property
    def limits(self) -> tuple[LimitUse, ...]:  # type: ignore[override]
        """Limits over continuous time, computed from the coefficients."""
        return self.recomputed.motion

    @property
    def transfer_limits(self) -> dict[str, tuple[LimitUse, ...]]:
        """The same of approach and return, per segment."""
        return self.recomputed.transfers

    @cached_property
    def target(self) -> IdentificationTarget:
        """Model to identify, with its base columns."""
        return target_of(self.robot, self.task)

    @cached_property
    def measured(self) -> MotionMeasures:
        """Metrics of the motion, computed from its coefficients.

        Raises
        ------
        InputError
            A model that the file only names.
        """
        model, task = self.target.model, self.task
        samples = self.trajectory.samples(model.times(self.trajectory.duration, task.output.rate))
        return MotionMeasures.of(self.target, samples, noise_per_row(task.objective.noise, model))

    @cached_property
    def _criteria(self) -> tuple[Mapping[str, float], str]:
        """Metrics, and why they are those of the file; empty where they are computed.

        Where the file agrees but for rounding, which differs from process to process, a metric has its very bits.
        """
        stated = self.content["criteria"]
        try:
            known = self.measured.criteria
            return {name: _confirmed(value, stated.get(name)) for name, value in known.items()}, ""
        except InputError as error:
            return {name: math.inf if value is None else float(value) for name, value in stated.items()}, str(error)

    @property
    def criteria(self) -> Mapping[str, float]:  # type: ignore[override]
        """Metrics, computed from the coefficients; those of the file where its model is not given."""
        return self._criteria[0]

    @property
    def believed(self) -> tuple[str, ...]:
        """What is not computed from the coefficients, but as the file states it, and why."""
        why = self._criteria[1]
        criteria = f"criteria and predictions are those that its file states: {why}" if why else ""
        return tuple(filter(None, [self.recomputed.believed, criteria]))

    @property
    def recomputed_content(self) -> dict[str, Any]:
        """The whole file, with what is computed from the coefficients in place of what it states."""
        ways = {name: [use.to_dict() for use in uses] for name, uses in self.transfer_limits.items()}
        played = {**self.content["played"]}
        played |= {name: {**played[name], "limits": limits} for name, limits in ways.items()}
        content = {**self.content, "feasible": self.feasible, "played": played}
        content |= {"limits": [use.to_dict() for use in self.limits]}
        if self._criteria[1]:
            return content
        base, predicted, known = self.content["base"], self.content["predicted"], self.measured
        return {
            **content,
            "criteria": {name: value if math.isfinite(value) else None for name, value in self.criteria.items()},
            "base": {**base, "rank": self.target.base.rank, "singular_values": known.spectrum.tolist()},
            "predicted": {**predicted, "parameters": [each.to_dict() for each in known.predicted]},
        }

    @property
    def coefficients_sha256(self) -> str:
        """Hash of the motion's coefficients, as ``design.json`` has it."""
        stated = self.content.get("sha256", {}).get("trajectory")
        return str(stated or entry_sha256(self.content["trajectory"]))

    @property
    def unchecked(self) -> tuple[Unchecked, ...]:  # type: ignore[override]
        """Kinds of limits that were not checked."""
        if "unchecked" in self.content:
            return tuple(Unchecked(each["limit"], each["reason"]) for each in self.content["unchecked"])
        torques = any(use["label"].endswith("torque") for use in self.content["limits"])
        checked = {"torque": torques, "collision": self.task.limits.world is not None}
        return tuple(Unchecked(limit, "not asked for") for limit, done in checked.items() if not done)

    @property
    def provenance(self) -> Mapping[str, Any]:  # type: ignore[override]
        """Date, versions, seed, times."""
        provenance: Mapping[str, Any] = self.content["provenance"]
        return provenance


def _confirmed(value: float, stated: object) -> float:
    """The stated value, where it is the computed one but for rounding."""
    same = isinstance(stated, float) and math.isclose(value, stated, rel_tol=_ROUNDING)
    return stated if isinstance(stated, float) and same else value


_SAME = 1e-6  # rad or m: poses that are written and read again


def stored_transfers(played: Mapping[str, Any]) -> ApproachAndReturn | None:
    """Approach and return that the entry ``played`` of a ``design.json`` describes, without their limits."""
    rate = float(played["rate"])
    transfers = {name: _transfer(played[name]) for name in (APPROACH, RETURN) if name in played}
    if not transfers:
        return None
    spans = {each["name"]: float(each["end"]) - float(each["start"]) for each in played["segments"]}
    settle = max(round((spans[name] - transfer.duration) * rate) for name, transfer in transfers.items())
    return ApproachAndReturn(transfers.get(APPROACH), transfers.get(RETURN), settle, rate, {})


def check_joined(transfers: ApproachAndReturn, ends: Array) -> None:
    """Raise `InputError` where approach and return do not meet the motion."""  # ends (2, n)
    meets = {APPROACH: (-1, ends[0]), RETURN: (0, ends[1])}
    for name, transfer in transfers.transfers.items():
        place, pose = meets[name]
        gap = float(np.abs(transfer.poses[place] - pose).max())
        if not gap <= _SAME:
            raise InputError(
                f"the {name} does not meet the motion, by {gap:.3g} rad (m): the entry 'trajectory' or 'played' was "
                "changed after the design was written; restore the file, or design the motion again"
            )


def _transfer(content: Mapping[str, Any]) -> Transfer:
    assumed: dict[str, tuple[str, ...]] = {"acceleration": (), "jerk": ()}
    return Transfer(tuple(_leg(leg) for leg in content["legs"]), float(content["shortest"]), assumed)


def _leg(content: Mapping[str, Any]) -> Leg:
    start, end = (np.array(content[name], dtype=float) for name in ("start", "end"))
    return Leg(start, end, SCurve.of_jerks(content["breaks"], content["jerk"]))
