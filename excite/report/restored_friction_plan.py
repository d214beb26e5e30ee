"""A plan of friction measurements read from its folder, with the motions that it is made of."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from excite.files.friction_plan_folder import KIND, PLAN, read_plan
from excite.friction.plan.measurements import Window
from excite.logs.csv_header import header_names
from excite.storage.destination import plain_name
from excite.storage.manifest import check_files
from excite.storage.records import complete
from regressors.errors import InputError
from regressors.input_files import LOG, read_text
from regressors.robot.robot import Robot
from regressors.samples import Array

_WINDOW = tuple(Window.__dataclass_fields__)
_NEEDED = (
    "coordinate", "unit", "file", "pose", "direction", "centre", "stroke", "gravity", "velocity", "assumed", "duration",
    "windows", "stiction", "left_out", "limits", "torques_unchecked", "distances", "torque_ramps", "no_torque_ramps",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class StoredFrictionPlan:
    """A plan read from its folder."""

    folder: Path
    robot: Robot
    content: Mapping[str, Any]  # of ``plan.json``

    @cached_property
    def runs(self) -> tuple[StoredRuns, ...]:
        """Runs of every coordinate."""
        with complete(self.folder / PLAN, "friction plan"):
            return tuple(_runs(self, each) for each in self.content["trajectories"])


@dataclass(frozen=True, eq=False)
class StoredRuns:
    """Motion of one coordinate."""

    content: Mapping[str, Any]  # entry of the plan
    time: Array  # (N,) [s]
    q: Array  # (N, n) of every joint of the robot [rad, rad/s, or with m]
    dq: Array  # (N, n)
    s: Array  # (N,) of the coordinate [rad, rad/s, or with m]
    ds: Array  # (N,)
    windows: tuple[Window, ...]


def load_friction_plan(folder: Path) -> StoredFrictionPlan:
    """Load the plan in a folder."""
    robot, content = read_plan(folder)
    with complete(folder / PLAN, "friction plan"):
        for each in content["trajectories"]:
            for name in _NEEDED:
                each[name]
        if not content["trajectories"]:
            raise ValueError("no trajectory")
    return StoredFrictionPlan(folder, robot, content)


def _runs(plan: StoredFrictionPlan, content: Mapping[str, Any]) -> StoredRuns:
    name = plain_name(content["file"], plan.folder / PLAN)
    check_files(plan.folder, KIND, (PLAN, name))
    robot, table = plan.robot, _table(plan.folder / name)
    q, dq = (np.column_stack([table[f"{j}.{what}"] for j in robot.joint_names]) for what in ("position", "velocity"))
    pose, line = (np.array([float(content[what][j]) for j in robot.joint_names]) for what in ("pose", "direction"))
    along = line / float(line @ line)
    windows = tuple(_window(each) for each in content["windows"])
    return StoredRuns(content, table["time"], q, dq, (q - pose) @ along + float(content["centre"]), dq @ along, windows)


def _window(content: Mapping[str, Any]) -> Window:
    known: dict[str, Any] = {key: np.nan if content[key] is None else content[key] for key in _WINDOW}
    return Window(**known)


def _table(path: Path) -> dict[str, Array]:
    """Columns of numbers of a trajectory file, by name."""
    text = read_text(path, LOG)
    header, _, rows = text.partition("\n")
    names = [name for name in header_names(header) if name != "segment"]
    try:
        values = np.loadtxt(io.StringIO(rows), delimiter=",", usecols=range(len(names)), ndmin=2)
    except ValueError as error:
        raise InputError(f"{path}: expected rows of numbers: {error}") from error
    if len(values) < 2 or not np.isfinite(values).all() or (np.diff(values[:, 0]) <= 0).any():
        raise InputError(f"{path}: expected finite numbers at increasing instants")
    return dict(zip(names, values.T, strict=True))
