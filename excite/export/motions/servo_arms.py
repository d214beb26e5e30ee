"""Commands for arms of hobby servos: data sets that LeRobot replays, and lists of positions as of sage.

A data set of LeRobot (version 3.0) is a folder: ``meta/info.json`` names the features and their elements,
``data/chunk-000/file-000.parquet`` has a row per frame, and ``meta/episodes`` and ``meta/tasks.parquet`` say where the
one episode is. ``lerobot-replay`` sends a frame's ``action`` every 1/fps: angles in degrees, and of a gripper the
per cent of its range.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from excite.export.motions.motion_format import Interpolation, MotionFile, MotionFormat, Recorder, channels
from excite.export.motions.sampled_design import SampledDesign
from excite.logs.recordings.recording import optional_package
from regressors.errors import InputError
from regressors.samples import Array

_GRIPPER = "gripper"  # whose positions LeRobot states in per cent of the range
_FRAMES = "data/chunk-000/file-000.parquet"


class _ServoArm(MotionFormat):
    """Positions of every joint, each of which a servo holds until the next."""

    fastest = 200.0
    default_rate = 50.0
    interpolation = Interpolation.NONE
    given = 0

    def recorder(self, motion: SampledDesign, name: str) -> Recorder:
        """Commands beside positions, as `identify` with the model servo reads them."""
        units = {"command": ("{}.command", "rad"), "position": ("{}.position", "rad")}
        return Recorder(
            channels(("time", "s"), motion.joints, **units),
            (
                "record: time [s], then NAME.command and NAME.position of every joint [rad], as a CSV file with this "
                "header, or a folder of sage, which is read without this mapping",
                f"rate: {motion.rate:g} Hz, that of the commands",
                "start marker: none; the arm rests before the motion and after it",
            ),
        )


class SageCommands(_ServoArm):
    """``control.csv`` of sage: ``type,timestamp,positions``, the time in us and the positions as a list [rad]."""

    name = "sage"
    suffix = ".csv"
    revolute = False
    checked = "when excite is tested, such files are read back beside the states of servos; none was played on a robot"

    def file(self, motion: SampledDesign, stem: str) -> MotionFile:
        """Header and rows; the program that reads them takes no comments."""
        lines = ["type,timestamp,positions"]
        for time, q in zip((1e6 * motion.time).tolist(), (motion.samples.q + 0.0).tolist(), strict=True):
            lines.append(f'CONTROL,{time:.3f},"{json.dumps(q)}"')
        return MotionFile("\n".join([*lines, ""]).encode())


class LeRobotDataset(_ServoArm):
    """Data set of one episode, whose actions are ``NAME.pos`` of every joint, for ``lerobot-replay``."""

    name = "lerobot"
    checked = (
        "when excite is tested, pyarrow reads such data sets back; LeRobot 0.4.4 has read one, no arm has played one"
    )

    def check_rate(self, rate: float) -> None:
        """Raise `InputError` where the rate is not a whole number of frames per second."""
        super().check_rate(rate)
        if rate != round(rate):
            raise InputError(f"`rate` {rate:g} Hz: the format {self.name} has a whole number of frames per second")

    def file(self, motion: SampledDesign, stem: str) -> MotionFile:
        """The files of the folder; ``meta/info.json``, without which there is no data set, is the last."""
        task = f"exciting motion of {motion.robot.name}, design {motion.sha256}"
        frames = _frames(motion)
        folder = {
            _FRAMES: _parquet(frames),
            "meta/tasks.parquet": _parquet({"task_index": [0], "task": [task]}, index="task"),
            "meta/episodes/chunk-000/file-000.parquet": _parquet(_episode(motion.time.size, task)),
            "meta/info.json": json.dumps(_info(motion, frames), indent=1).encode(),
        }
        return MotionFile(b"", _replaying(motion), folder)


def _frames(motion: SampledDesign) -> dict[str, Any]:
    """A row per frame: the action, shape (N, n), its time [s], and its numbers."""
    number, zero = np.arange(motion.time.size), np.zeros(motion.time.size, dtype=int)
    return {
        "action": _degrees(motion).astype(np.float32),
        "timestamp": motion.time.astype(np.float32),
        "frame_index": number,
        "episode_index": zero,
        "index": number,
        "task_index": zero,
    }


def _episode(count: int, task: str) -> dict[str, Any]:
    """The row of the one episode: its frames, and in which files they are."""
    return {
        "episode_index": [0],
        "tasks": [[task]],
        "length": [count],
        "dataset_from_index": [0],
        "dataset_to_index": [count],
        "data/chunk_index": [0],
        "data/file_index": [0],
        "meta/episodes/chunk_index": [0],
        "meta/episodes/file_index": [0],
    }


def _info(motion: SampledDesign, frames: Mapping[str, Any]) -> dict[str, Any]:
    """What ``meta/info.json`` says of the data set and its features, and the hashes of the design."""
    names = [f"{name}.pos" for name in motion.joints]
    features: dict[str, Any] = {
        name: {"dtype": str(x.dtype), "shape": [1], "names": None} for name, x in frames.items()
    }
    features["action"] |= {"shape": [len(names)], "names": names}
    return {
        "codebase_version": "v3.0",
        "robot_type": motion.robot.name,
        "total_episodes": 1,
        "total_frames": motion.time.size,
        "total_tasks": 1,
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": round(motion.rate),
        "splits": {"train": "0:1"},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": None,
        "features": features,
        "excite": {"design_sha256": motion.sha256, "coefficients_sha256": motion.design.coefficients_sha256},
    }


def _degrees(motion: SampledDesign) -> Array:
    """Positions as LeRobot's arms take them: degrees, and of a gripper per cent of its range."""
    q = np.degrees(motion.samples.q) + 0.0
    limits = motion.design.robot.limits
    for k in _grippers(motion):
        low, high = limits.lower[k], limits.upper[k]
        q[:, k] = 100.0 * (motion.samples.q[:, k] - low) / (high - low)
    return np.asarray(q)


def _grippers(motion: SampledDesign) -> list[int]:
    return [k for k, name in enumerate(motion.joints) if name == _GRIPPER]


def _replaying(motion: SampledDesign) -> tuple[str, ...]:
    gripper = ", of the gripper per cent of its range in the description" * bool(_grippers(motion))
    return (
        f"actions are degrees from the description's zero{gripper}: compare zero, sign and range of every joint with "
        "your calibration by small movements first",
        "lerobot-replay sends the commands and records nothing: to identify, record positions beside them",
    )


def _parquet(columns: Mapping[str, Any], index: str | None = None) -> bytes:
    """A table in Parquet, and which of its columns is the index that pandas gives it."""
    arrow = optional_package("pyarrow", "parquet", "the format lerobot")
    parquet = optional_package("pyarrow.parquet", "parquet", "the format lerobot")
    lists = {name: list(values) if np.ndim(values) > 1 else values for name, values in columns.items()}
    table = arrow.table({name: arrow.array(values) for name, values in lists.items()})
    if index is not None:
        text = {"name": index, "field_name": index, "pandas_type": "unicode", "numpy_type": "object", "metadata": None}
        known = {"index_columns": [index], "column_indexes": [], "columns": [text]}
        table = table.replace_schema_metadata({"pandas": json.dumps(known)})
    stream = arrow.BufferOutputStream()
    parquet.write_table(table, stream)
    return bytes(stream.getvalue().to_pybytes())
