"""A folder of friction measurements: ``plan.json``, and one or two trajectory files per coordinate.

``NAME.csv`` holds the motion with its segments; ``NAME.stiction.csv`` holds the pose, and slow ramps of the torque of
one drive, ``DRIVE.effort``, in segments such as ``z1 stiction +``. There the drive is controlled by torque until it has
moved, then by position again, which brings it back; the controller adds the torque of gravity in the pose.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from excite.files.stored import stored_content, stored_robot
from excite.files.trajectory_csv import SEGMENT
from excite.friction.plan.measurements import CoordinatePlan, Distance, FrictionPlan, Window
from excite.friction.plan.schedule import Schedule
from excite.friction.plan.torque_ramps import TorqueRamps
from excite.logs.csv_header import header_text
from excite.storage.atomic import replacing, write_json
from excite.storage.commit import read_settled
from excite.storage.destination import Destination
from excite.storage.figure_names import figure_names
from excite.storage.finite import check_table
from excite.storage.manifest import check_files
from excite.storage.records import complete
from excite.storage.result_folder import check_not_taken, replace_result, result_folder
from regressors.errors import InputError
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

SCHEMA = "excite.friction-plan/1"
PLAN, FIGURE, KIND = "plan.json", "runs", "friction-plan"
ORDER = "warm-up; break away in both directions; then fastest, slowest, next fastest, next slowest ... there and back"


def check_free(folder: Path, names: Collection[str] = (), *, replace: bool = False) -> None:
    """Raise `TakenError` where a folder holds a plan, or other files of the given names, that may not be replaced."""
    check_not_taken(folder, PLAN, "a friction plan", names, replace=replace)


def save_plan(plan: FrictionPlan, folder: str | Path, *, replace: bool = False) -> list[Path]:
    """Write a plan into a folder, which is created if it does not exist."""
    folder = Path(folder)
    with result_folder(folder) as run:
        check_free(folder, data_files(plan), replace=replace)
        return write_plan(plan, folder, run=run)


def file_name(label: str) -> str:
    """Name of a coordinate's trajectory file, such as ``z1.csv``."""
    return re.sub(r"[^\w.-]", "_", label) + ".csv"


def stiction_file_name(label: str) -> str:
    """Name of the file with a coordinate's torque ramps, such as ``z1.stiction.csv``."""
    return file_name(label).removesuffix(".csv") + ".stiction.csv"


def data_files(plan: FrictionPlan) -> list[str]:
    """Names of a plan's files beside the figure, ``plan.json`` first."""
    runs = [file_name(coordinate.label) for coordinate in plan.coordinates]
    ramps = [stiction_file_name(coordinate.label) for coordinate in plan.coordinates if coordinate.ramps is not None]
    if len({*runs, *ramps}) < len(runs) + len(ramps):
        raise InputError(f"names of two coordinates make the same file name: {', '.join(runs)}")
    return [PLAN, *runs, *ramps]


def write_plan(plan: FrictionPlan, folder: Path, *, run: str | None = None) -> list[Path]:
    """Write a plan's files, and replace an older plan, all at once."""
    names = data_files(plan)
    with replace_result(folder, KIND, run=run, older=_older_files(folder)) as staged:
        for coordinate in plan.coordinates:
            samples, segments = coordinate.samples()
            _write(staged / file_name(coordinate.label), *_columns(plan.robot, samples), segments)
            if coordinate.ramps is not None:
                samples, torque, segments = coordinate.ramps.samples(coordinate.place.pose)
                header, columns = _columns(plan.robot, samples)
                header = [*header, f"{coordinate.ramps.drive}.effort"]
                _write(staged / stiction_file_name(coordinate.label), header, [*columns, torque], segments)
        write_json(staged / PLAN, plan_content(plan))
    return [folder / name for name in names]


def _older_files(folder: Path) -> list[str]:
    """Files of a plan that was written without a manifest: the trajectories that it names, and the figure."""
    if not (folder / PLAN).exists():
        return []
    with complete(folder / PLAN, "friction plan"):
        names = _named_files(stored_content(folder / PLAN, SCHEMA))
    return [*(name for name in names if name == Path(name).name and name.endswith(".csv")), *figure_names([FIGURE])]


def _named_files(content: dict[str, Any]) -> list[str]:
    trajectories = content["trajectories"]
    written = [*trajectories, *(each["torque_ramps"] for each in trajectories if each.get("torque_ramps"))]
    return [str(each["file"]) for each in written]


def plan_content(plan: FrictionPlan) -> dict[str, Any]:
    """Content of ``plan.json``."""
    robot = plan.robot
    return {
        "schema": SCHEMA,
        "robot": {"name": robot.name, "sha256": robot.sha256(), "description": robot.description()},
        "units": "SI, angles in radians; speeds in percent of the largest one",
        "schedule": _schedule_content(plan.schedule),
        "order": ORDER,
        "world": None if plan.world is None else plan.world.to_dict(),
        "not_looked_at": list(plan.notes),
        "passages": [asdict(passage) for passage in plan.passages],
        "trajectories": [_coordinate_content(robot, coordinate) for coordinate in plan.coordinates],
    }


def read_plan(folder: Path) -> tuple[Robot, dict[str, Any]]:
    """Robot and content of a plan."""
    return read_settled(Destination(folder), lambda: _plan(folder))


def _plan(folder: Path) -> tuple[Robot, dict[str, Any]]:
    path = folder / PLAN
    content = stored_content(path, SCHEMA)
    with complete(path, "friction plan"):
        robot = stored_robot(content)
    check_files(folder, KIND, (PLAN,))
    return robot, content


def _schedule_content(schedule: Schedule) -> dict[str, Any]:
    """Fields of the schedule; unbounded strokes and windows become null."""
    unbounded = {name: _known(getattr(schedule, name)) for name in ("longest", "stroke")}
    return {**asdict(schedule), "percent": list(schedule.percent), **unbounded}


def _coordinate_content(robot: Robot, plan: CoordinatePlan) -> dict[str, Any]:
    pace = plan.pace
    return {
        "coordinate": plan.label,
        "unit": plan.unit,
        "turns": list(plan.turns),
        "file": file_name(plan.label),
        "pose": dict(zip(robot.joint_names, plan.place.pose.tolist(), strict=True)),
        "direction": dict(zip(robot.joint_names, plan.motion.matrix[:, 0].tolist(), strict=True)),
        "centre": plan.centre,
        "stroke": plan.stroke,
        "gravity": plan.place.gravity,
        "largest_gravity": _known(plan.largest_gravity),
        "velocity": pace.velocity,
        "acceleration": pace.acceleration,
        "jerk": pace.jerk,
        "assumed": list(pace.assumed),
        "duration": plan.runs.duration,
        "order": plan.order,
        "windows": [_window_content(window) for window in plan.windows],
        "stiction": [
            {
                "segment": part.segment,
                "direction": 1 if part.end > part.start else -1,
                "start": part.begin,
                "end": part.begin + (0.0 if part.law is None else part.law.duration),
            }
            for part in plan.breakaways
        ],
        "left_out": [{"percent": percent, "reason": reason} for percent, reason in plan.left_out.items()],
        "limits": [use.to_dict() for use in plan.limits],
        "torques_unchecked": plan.torques_unchecked,
        "distances": None if plan.distances is None else [_distance_content(each) for each in plan.distances],
        "torque_ramps": None if plan.ramps is None else _ramps_content(plan.label, plan.ramps),
        "no_torque_ramps": plan.no_ramps,
    }


def _distance_content(distance: Distance) -> dict[str, Any]:
    """Certificate, with the position of the coordinate where the bodies are nearest."""
    return {**distance.use.to_dict(), "at": distance.at}


def _ramps_content(label: str, ramps: TorqueRamps) -> dict[str, Any]:
    return {
        "file": stiction_file_name(label),
        "drive": ramps.drive,
        "unit": ramps.unit,
        "largest": ramps.largest,
        "origin": ramps.origin,
        "gravity": _known(ramps.gravity),
        "duration": ramps.duration,
        "ramps": [asdict(ramp) for ramp in ramps.ramps],
    }


def _window_content(window: Window) -> dict[str, Any]:
    return {
        **asdict(window),
        "gravity": _known(window.gravity),
        "direction": 1 if window.speed > 0.0 else -1,
    }


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _columns(robot: Robot, samples: Samples) -> tuple[list[str], list[Array]]:
    """Time, and position, velocity and acceleration of every joint, as in a design's file."""
    header, columns = ["time"], [samples.time]
    for joint, name in enumerate(robot.joint_names):
        header += [f"{name}.{what}" for what in ("position", "velocity", "acceleration")]
        columns += [samples.q[:, joint], samples.dq[:, joint], samples.ddq[:, joint]]
    return header, columns


def _write(path: Path, header: list[str], columns: list[Array], segments: list[str]) -> None:
    """Write the columns, and the segment of each sample."""
    form, table = ",".join(["%.17g"] * len(header)), np.column_stack(columns)
    check_table(path, header, table)
    with replacing(path) as stream:
        stream.write(header_text([*header, SEGMENT]) + "\n")
        stream.writelines(f"{form % tuple(row)},{segment}\n" for row, segment in zip(table, segments, strict=True))
