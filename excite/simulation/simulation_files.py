"""Files that a simulation plays, and those that it writes: logs, with what is known of them beside."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from excite.design.design import Design
from excite.design.design_folder import DESIGN, KIND as OF_DESIGN, TRAJECTORY
from excite.design.design_json import load_design
from excite.design.friction_runs.friction_plan import KIND as OF_PLAN, PLAN, load_friction_plan
from excite.logs.log_reading import KIND, LOG, log_entry, sidecar_path, write_log
from excite.simulation.simulation import Simulation
from excite.storage.atomic import Destination, read_json, write_json
from excite.storage.codec import content_of
from excite.storage.commit import read_settled
from excite.storage.manifest import check_files, sha256_of
from excite.storage.migrations import schema_of
from excite.storage.result_folder import check_free, replace_files, result_file
from excite.storage.sampled_motion import SEGMENT, read_table
from excite.tasks.reference import GivenTorque, MotionSource, SampledMotion
from excite.tasks.task import Task
from regressors.errors import InputError, check_names
from regressors.robot.friction.load_and_temperature import drives_with_friction
from regressors.robot.robot import Robot
from regressors.samples import Samples


def read_source(
    source: Design | str | Path, file: Path | None = None, *, approach_and_return: bool = True
) -> MotionSource:
    """Read the motion of a design or its folder, of a replacement file, or of a file of a friction plan."""
    if isinstance(source, Design):
        return _of_design(source, file, approach_and_return=approach_and_return)
    source = Path(source)
    if source.suffix == ".csv":
        if file is not None:
            raise InputError(f"two files to play are given: {source} and {file}")
        return read_settled(Destination(source.parent), lambda: _of_plan(source))
    if (source / PLAN).exists() and not (source / DESIGN).exists():
        file = source / load_friction_plan(source).coordinates[0].file
        raise InputError(f"{source} holds a friction plan: name the file to play, such as {file}")
    return read_settled(
        Destination(source), lambda: _of_design(load_design(source), file, approach_and_return=approach_and_return)
    )


def _of_design(design: Design, file: Path | None, *, approach_and_return: bool) -> MotionSource:
    folder, more = design.folder, len(design.sequence.pieces) > 1
    if file is None and approach_and_return and folder is not None and more:
        file = folder / TRAJECTORY
    if file is not None and file.parent == folder:
        check_files(folder, OF_DESIGN, (DESIGN, file.name))  # what is played beside the motion, or a rehearsal
    origin = {
        "folder": None if folder is None else folder.name,
        "sha256": None if folder is None else sha256_of(folder / DESIGN),
    }
    motion = design.trajectory if file is None else read_motion(file, design.moving.joint_names)
    ramps = None if file is None else read_torque(file, design.moving)
    return MotionSource(design.robot, design.task, motion, ramps, file, {"design": origin, "friction_plan": None})


def _of_plan(file: Path) -> MotionSource:
    """Read a file of a friction plan, which may move any joint of its robot."""
    if not (file.parent / PLAN).exists():
        raise InputError(
            f"{file}: there is no {PLAN} of a friction plan in its folder; to play a file with a design, give the "
            f"folder of the design and `trajectory={str(file)!r}`"
        )
    robot = load_friction_plan(file.parent).robot
    check_files(file.parent, OF_PLAN, (PLAN, file.name))
    plan = {"folder": file.parent.resolve().name, "sha256": sha256_of(file.parent / PLAN)}
    return MotionSource(
        robot,
        Task(robot.name, joints=robot.joint_names),
        read_motion(file, robot.joint_names),
        read_torque(file, robot),
        file,
        {"design": None, "friction_plan": plan},
    )


RATES = ("position", "velocity", "acceleration")
_STILL = 1e-9  # rad or m


def read_motion(path: Path, joints: Sequence[str]) -> SampledMotion:
    """Read a motion from a file, with quintics between its samples."""
    header, table, _ = read_table(path, RATES)
    column = {name: table[:, k] for k, name in enumerate(header)}
    check_names(f"column in {path}", ("time", *(f"{joint}.{rate}" for joint in joints for rate in RATES)), header)
    for name, values in column.items():
        joint, _, what = name.rpartition(".")
        if what == "position" and joint not in joints and values.size and np.ptp(values) > _STILL:
            raise InputError(
                f"{path}: {joint} moves, but the design holds it still and moves {', '.join(joints)}; "
                "`approach_and_return=False` leaves out the approach from home and the return"
            )
    q, dq, ddq = (np.column_stack([column[f"{joint}.{rate}"] for joint in joints]) for rate in RATES)
    try:
        return SampledMotion(Samples(column["time"], q, dq, ddq, np.full_like(q, np.nan)))
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


STICTION = "stiction"
_EFFORT = ".effort"


def read_torque(path: Path, robot: Robot) -> GivenTorque | None:
    """Torque ramps of a file, stretches of segments whose name contains ``stiction``; None where it has none."""
    header, table, text = read_table(path, ("effort",), SEGMENT)
    efforts = [name for name in header if name.endswith(_EFFORT)]
    ramping = np.array([STICTION in name for name in text], dtype=bool)
    if not efforts or not ramping.any():
        return None
    if len(efforts) > 1:
        raise InputError(f"{path}: one drive at a time can be given torques, there are columns {', '.join(efforts)}")
    drive, known = efforts[0].removesuffix(_EFFORT), [name for name, _ in drives_with_friction(robot)]
    kind = "drive" if robot.transmission else "joint"
    check_names(f"{kind} for column {efforts[0]} of {path}", [drive], known)
    before = ["", *text[:-1]]
    begins = ramping & np.array([a != b for a, b in zip(before, text, strict=True)])
    number = np.where(ramping, np.cumsum(begins), 0)
    return GivenTorque(drive, table[:, header.index("time")], table[:, header.index(efforts[0])], number)


def paths_of(log: Path, *, wrench: bool, replace: bool = False) -> list[tuple[Path, Path]]:
    """Paths of log and sidecar of the joints, and of the wrench where there is one, checked to be writable."""
    if log.suffix != ".csv":
        raise InputError(f"{log}: expected a name that ends in .csv")
    logs = [log, log.with_suffix(".wrench.csv")] if wrench else [log]
    pairs = [(path, sidecar_path(path)) for path in logs]
    check_free(*(path for pair in pairs for path in pair), replace=replace)
    return pairs


def save_simulation(simulation: Simulation, log: str | Path, *, replace: bool = False) -> list[Path]:
    """Write the logs of a simulated run with their sidecars, and replace older ones, all at once."""
    log = Path(log)
    logs = [simulation.log] if simulation.wrench_log is None else [simulation.log, simulation.wrench_log]
    with result_file(log):
        pairs = paths_of(log, wrench=simulation.wrench_log is not None, replace=replace)
        content = {"schema": schema_of(KIND), **content_of(simulation.record)[0]}
        with replace_files(log, remove=_older_wrench(log)) as staged:
            for (path, beside), recorded in zip(pairs, logs, strict=True):
                write_log(recorded, staged / path.name)
                write_json(staged / beside.name, {**content, **log_entry(staged / path.name)})
    return [path for pair in pairs for path in pair]


def _older_wrench(log: Path) -> list[str]:
    """Wrench log of the run that is replaced, which leaves with it; its sidecar is that of the joints."""
    path = log.with_suffix(".wrench.csv")
    try:
        of_joints, of_wrench = (read_json(sidecar_path(each)) for each in (log, path))
    except InputError:
        return []
    of_joints.pop(LOG, None)  # of the one file alone
    of_wrench.pop(LOG, None)
    return [path.name, sidecar_path(path).name] if of_joints == of_wrench else []
