"""Reader of ``design.json``, and of the tasks that designs and results store."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from constraints.world_file import world_of
from excite.design.approach import ApproachAndReturn
from excite.design.design import Design
from excite.design.design_folder import DESIGN, HASHES, KIND, TRAJECTORY, load_precision_search
from excite.design.formulation import INSTANTS, task_motion_of
from excite.design.start_results import or_infinite
from excite.design.task_file import task_from_options
from excite.registry import OwnPart, is_own
from excite.storage.atomic import Destination, read_json
from excite.storage.commit import read_settled
from excite.storage.manifest import check_files, entry_sha256, sha256_of
from excite.storage.migrations import is_of_kind
from excite.storage.records import complete, read_record
from excite.storage.sampled_motion import read_table
from excite.tasks.robot_of_task import moving_robot
from excite.tasks.stored_files import EarlierInformation, InitialDesign, StoredRobot, TaskMotion
from excite.tasks.task import Task
from excite.trajectories.closed import stored_motion
from excite.trajectories.sequence import WholeRobotMotion
from regressors.arguments import checked
from regressors.errors import InputError, about, reading
from regressors.input_files import read_text
from regressors.readers.documents import parse_document
from regressors.readers.library import built_in_names
from regressors.robot.archive import robot_from_description
from regressors.robot.robot import Robot
from regressors.samples import Array


@checked
def load_design(folder: str | Path, part: str | Collection[str] = (), **own: Any) -> Design:
    """Load the design in a folder, or in a ``design.json``.

    Parameters
    ----------
    folder : path
    part : str or collection of str
        User-defined parts, as ``module:Name``, that may be imported if the design names them.
    **own
        Options of the task that replace those of the file. User-defined parts, as objects: ``model``, ``trajectory``,
        ``criterion``, ``solver``, ``constraints`` (all of them); files only name such parts, and nothing else is
        imported for them. And files that a design names without their content, such as ``world``: they are not opened
        either.

    Raises
    ------
    InputError
        There is no design, it has another schema, its robot, its coefficients or a file of its motion do not match
        their hash, or its trajectory belongs to a user-defined family that is not given. Other missing parts and files
        raise an error where they are needed.
    """
    folder = Path(folder)
    path = folder if folder.suffix == ".json" else folder / DESIGN
    allowed = (part,) if isinstance(part, str) else part
    return read_settled(Destination(path.parent), lambda: _design(folder, path, allowed, own))


def _design(folder: Path, path: Path, allowed: Collection[str], own: dict[str, Any]) -> Design:
    if not path.exists():
        raise InputError(f"{folder} holds no design: there is no {path}")
    content = read_json(path)
    with complete(path, KIND):  # what was edited is named before the manifest says that something was
        objects = _objects(content, path.parent, allowed, own) if is_of_kind(KIND, content.get("schema")) else {}
    design = read_record(path, Design, KIND, lambda _: objects)
    if path.name == DESIGN:
        check_files(path.parent, KIND, (DESIGN, TRAJECTORY))
    return design


def _objects(
    content: Mapping[str, Any], folder: Path, allowed: Collection[str], own: Mapping[str, Any]
) -> dict[str, Any]:
    """Entries of the fields that the codec leaves to the reader, checked against each other."""
    robot = stored_robot(content)
    task = stored_task(content, robot, allowed, own)
    chosen = task.trajectory.trajectory
    if isinstance(chosen, OwnPart):
        raise chosen.missing()
    family = None if isinstance(chosen, str) and not is_own(chosen) else task.trajectory.family()
    moving = moving_robot(robot, task)
    trajectory = stored_motion(content["trajectory"], moving, family)
    _check_motion(content, folder)
    float(content["provenance"]["cpu_seconds"])
    if "condition_number" not in content["criteria"]:
        raise KeyError("condition_number")
    if "played" not in content and task.output.home is not None:
        raise KeyError("played")  # it would be played without its approach and return
    transfers = ApproachAndReturn.of(content["played"]) if "played" in content else None
    if transfers is not None:
        whole = WholeRobotMotion(trajectory, task.limits.applied(robot), moving.joint_names)
        transfers.check_joined(whole.samples(np.array([0.0, whole.duration])).q)
    return {
        "robot": robot,
        "task": task,
        "trajectory": trajectory,
        "stated_series": content["trajectory"],
        "criteria": {name: float(or_infinite(value)) for name, value in content["criteria"].items()},
        "minimised_value": float(or_infinite(content.get("minimised_value"))),
        "approach_and_return": transfers,
        "unchecked": content["unchecked"] if "unchecked" in content else _unchecked(content, task),
        "folder": folder,
        "precision_search": load_precision_search(folder),
    }


def _unchecked(content: Mapping[str, Any], task: Task) -> list[dict[str, str]]:
    """Kinds of limits that were not checked by versions that did not write them down."""
    torques = any(use["label"].endswith("torque") for use in content["limits"])
    checked = {"torque": torques, "collision": task.limits.world is not None}
    return [{"limit": limit, "reason": "not asked for"} for limit, done in checked.items() if not done]


def _check_motion(content: Mapping[str, Any], folder: Path) -> None:
    """Check that the motion of a design, and its files that are beside it, are those that were written.

    A design of a version without hashes is taken as it is.
    """
    hashes = content.get(HASHES)
    if hashes is None:
        return
    if entry_sha256(content["trajectory"]) != hashes["trajectory"]:
        raise InputError(
            "the coefficients of the motion (entry 'trajectory') were changed after the design was written: their "
            "SHA-256 is not the one in the entry 'sha256'; restore the file, or design the motion again"
        )
    for name, expected in hashes["files"].items():
        if name == Path(name).name and sha256_of(folder / name) not in (None, expected):
            raise InputError(
                f"{name} beside it was changed after the design was written: its SHA-256 is not the one in the entry "
                "'sha256'; restore the file, or design the motion again; to play a motion of your own, move it to "
                "another folder and name it with `trajectory`"
            )


def stored_robot(content: Mapping[str, Any]) -> Robot:
    """Robot of a file's ``robot`` entry."""
    robot = robot_from_description(content["robot"]["description"])
    if robot.sha256() != content["robot"]["sha256"]:
        raise InputError("the robot's description does not have the hash that the file states")
    return robot


def stored_task(content: Mapping[str, Any], robot: Robot, allowed: Collection[str], own: Mapping[str, Any]) -> Task:
    """The task of a design or a result.

    A robot that is not built in is the one that the file describes, so that the task can be run again without the file
    that it was read from.
    """
    options, shape = dict(content["task"]), content.get("shape")
    if str(options["robot"]) not in built_in_names():
        options["robot"] = StoredRobot(
            str(options["robot"]), robot, None if shape is None else world_of(shape, "shape of the robot")
        )
    elif shape is None and not robot.shapes:  # built in, of a time when the built-in robots had none
        options["self_collision"] = False
    if content.get("begins_with") is not None:
        options["begin"] = InitialDesign(str(options.get("begin")), content["begins_with"])
    if content.get("after") is not None:
        options["after"] = [_earlier(each) for each in content["after"]]
    return task_from_options(options, stored=True, allowed=allowed, **own)


def _earlier(content: Mapping[str, Any]) -> EarlierInformation:
    """Information in hand as a design holds it."""
    density, values = content["density"], content["values"]
    return EarlierInformation(
        **{
            **content,
            "A": _dense(content["A"]),
            "logs": tuple(content["logs"]),
            "parameters": tuple(content["parameters"]),
            "factors": tuple(_dense(F) for F in content["factors"]),
            "equations": tuple((str(name), str(unit)) for name, unit in content["equations"]),
            "density": None if density is None else tuple(float(x) for x in density),
            "values": None if values is None else np.array([np.nan if x is None else float(x) for x in values]),
        }
    )


def _dense(content: Mapping[str, Any]) -> Array:
    A = np.zeros(tuple(content["shape"]))
    A[content["rows"], content["columns"]] = content["values"]
    return A


_MOST = 1000  # folders in one folder that are looked into


def find_design(sha256: str, folders: Iterable[str | Path]) -> Path | None:
    """Folder of the design with a hash, among some folders and those directly in them.

    Only files of the name ``design.json`` are read, and nothing that they name is opened.
    """
    return next((place for place in _places(folders) if sha256 in design_hashes(place)), None)


def _places(folders: Iterable[str | Path]) -> Iterator[Path]:
    for folder in map(Path, folders):
        yield folder
        if folder.is_dir():
            yield from sorted(path for path in islice(folder.iterdir(), _MOST) if path.is_dir())


def design_hashes(folder: Path) -> frozenset[str]:
    """Hashes by which the design in a folder may be named; none if there is no readable one."""
    path = folder / DESIGN
    try:
        whole = sha256_of(path)
        if whole is None:
            return frozenset()
        content = read_json(path)
        stated = content.get(HASHES, {}).get("trajectory") or entry_sha256(content["trajectory"])
    except (InputError, OSError, KeyError, AttributeError, TypeError, ValueError):
        return frozenset()
    return frozenset({whole, str(stated)})


_COLUMNS = ("position", "velocity", "acceleration")


def read_task_motion(place: str | Path) -> TaskMotion:
    """Read the motion whose torques a design is to predict."""
    path = Path(place)
    if path.suffix != ".csv":
        return task_motion_of(load_design(path))
    header, table, _ = read_table(path, _COLUMNS)
    joints = [name.removesuffix(".position") for name in header if name.endswith(".position")]
    wanted = [[f"{joint}.{what}" for joint in joints] for what in _COLUMNS]
    missing = [name for names in wanted for name in names if name not in header]
    if not joints or missing or not len(table):
        lacking = ", ".join(missing[:3]) or ("rows" if joints else "columns NAME.position of joints")
        raise InputError(f"task_motion {path}: {lacking} missing; expected the columns of trajectory.csv")
    rows = np.unique(np.linspace(0, len(table) - 1, min(INSTANTS, len(table))).round().astype(int))
    q, dq, ddq = (table[rows][:, [header.index(name) for name in names]] for names in wanted)
    return TaskMotion(str(place), tuple(joints), q, dq, ddq)


def read_precision_target(path: Path) -> dict[str, Any]:
    """Read a file such as ``share: 0.05`` and ``parameters: {X5: 0.1}``."""
    with about("precision: expected a share such as 5%, or a file"), reading(str(path)):
        text = read_text(path)
    document = parse_document(text, str(path))
    assert isinstance(document.content, dict)
    content = {str(name): value for name, value in document.content.items()}
    if isinstance(entry := content.get("torques"), dict):  # ``torques: {motion: FILE, share: 0.05}``
        if set(entry) != {"motion", "share"}:
            given = ", ".join(map(str, entry))
            raise InputError(f"{path}: torques: expected `motion:`, a file, and `share:`; given {given}")
        motion = read_task_motion(path.parent / str(entry["motion"]))  # a folder or a table beside the file
        content["torques"] = {"share": entry["share"], "motion": motion}
    return content
