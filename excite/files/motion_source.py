"""Reader of the motion that a simulated robot executes: that of a design, or a file of a friction plan."""

from __future__ import annotations

from math import isfinite
from pathlib import Path

from excite.design.designed_motion import DesignedMotion
from excite.files.design_folder import DESIGN, TRAJECTORY
from excite.files.design_folder import KIND as OF_DESIGN
from excite.files.design_json import load_design
from excite.files.sampled_motion import read_motion
from excite.files.torque_ramp_columns import read_torque
from excite.friction.plan.friction_plan import KIND as OF_PLAN
from excite.friction.plan.friction_plan import PLAN, load_friction_plan
from excite.simulation.reference import MotionSource
from excite.storage.commit import read_settled
from excite.storage.destination import Destination
from excite.storage.manifest import check_files, sha256_of
from excite.tasks.task import Task
from regressors.errors import InputError


def read_source(
    source: DesignedMotion | str | Path, file: Path | None = None, *, approach_and_return: bool = True
) -> MotionSource:
    """Read the motion of a design or its folder, of a replacement file, or of a file of a friction plan."""
    if isinstance(source, DesignedMotion):
        return _of_design(source, file, approach_and_return=approach_and_return)
    source = Path(source)
    if source.suffix == ".csv":
        if file is not None:
            raise InputError(f"two files to play are given: {source} and {file}")
        return read_settled(Destination(source.parent), lambda: _of_plan(source))
    if (source / PLAN).exists() and not (source / DESIGN).exists():
        raise InputError(f"{source} holds a friction plan: name the file to play, such as {_some_file(source)}")
    return read_settled(
        Destination(source), lambda: _of_design(load_design(source), file, approach_and_return=approach_and_return)
    )


def _of_design(design: DesignedMotion, file: Path | None, *, approach_and_return: bool) -> MotionSource:
    folder = design.folder
    if file is None and approach_and_return and folder is not None and design.task.output.home is not None:
        file = folder / TRAJECTORY
    if file is not None and file.parent == folder:
        check_files(folder, OF_DESIGN, (DESIGN, file.name))  # the approach and return, or a rehearsal
    origin = {
        "folder": None if folder is None else folder.name,
        "sha256": None if folder is None else sha256_of(folder / DESIGN),
        "condition_number": design.condition_number if isfinite(design.condition_number) else None,
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


def _some_file(folder: Path) -> str:
    return str(folder / load_friction_plan(folder).coordinates[0].file)
