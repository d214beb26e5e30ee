"""The section of a verification."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from excite.files.result_json import load_result
from excite.files.stored import complete, stored_content
from excite.files.verification_curves import CURVES, read_verification_curves, verification_curves
from excite.files.verification_json import SCHEMA, verification_content
from excite.identification.result import StoredResult
from excite.report.drawings import drawn, no_pictures, pictures
from excite.report.player_log import Appearance, logged_instants, played
from excite.report.provenance_facts import facts
from excite.report.restored_verification import restored_verification
from excite.report.sections import ReportCell, ReportFigure, ReportSection, ReportTable, number, percent, unit
from excite.report.stored_curves import stored_curves
from excite.storage.commit import read_settled
from excite.storage.destination import Destination
from excite.storage.manifest import check_files
from excite.tasks.stored_files import StoredRobot
from excite.tasks.task import Task
from excite.verification.verification import Verification
from regressors.errors import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_TITLES = {
    "torques": "Predicted and measured",
    "motion": "Simulated and measured motion",
    "parts": "What the errors are made of",
}


@dataclass(frozen=True)
class StoredVerification:
    """A verification read from its file.

    Parameters
    ----------
    path : Path
    content : mapping
    """

    path: Path
    content: Mapping[str, Any]

    @property
    def name(self) -> str:
        """Its file."""
        return str(self.path)


def load_verification(path: Path) -> StoredVerification:
    """Load a ``verification-LOG.json``.

    Raises
    ------
    InputError
        Another schema, entries that are missing, or a file that is not the one that was written.
    """
    return read_settled(Destination(path.parent), lambda: _loaded(path))


def _loaded(path: Path) -> StoredVerification:
    content = stored_content(path, SCHEMA)
    with complete(path, "verification"):
        for name in ("holds", "verdict", "against", "remarks", "relative_error", "torques", "motions", "log", "robot"):
            content[name]
    check_files(path.parent, path.stem, (path.name,))
    return StoredVerification(path, content)


def verification_section(
    verification: StoredVerification | Verification, prefix: str, looks: Appearance
) -> ReportSection:
    """Everything that a page says of a verification.

    Parameters
    ----------
    verification : StoredVerification or Verification
    prefix : str
        Begins the identifiers of its figures.
    looks : Appearance
        Of the robot, in the player.
    """
    if isinstance(verification, StoredVerification):
        return _stored(verification, prefix, looks)
    content = verification_content(verification)
    figures, missing = drawn(_figures(verification), prefix)
    arrays, robot = verification_curves(verification), verification.robot
    logged = logged_instants(arrays, content["log"]["file"], verification.equations)
    motion, unseen = played(logged, robot, Task(StoredRobot(robot.name, robot)), looks)
    section = _section(content, f"verification on {content['log']['file']}", figures, (*unseen, *missing))
    return replace(section, motion=motion)


def _stored(verification: StoredVerification, prefix: str, looks: Appearance) -> ReportSection:
    """Drawn from the curves in the folder, else with the pictures there."""
    content, path = verification.content, verification.path
    name = f"{path.stem}{CURVES}"
    count = len(content["torques"])
    arrays, note = stored_curves(path.parent, path.stem, name, lambda file: read_verification_curves(file, count))
    notes = (note,) if note else ()
    command = shlex.join(["excite", "verify", str(path.parent), str(content["log"]["file"])])
    result = None if arrays is None else _result(path.parent, content)
    if arrays is None or result is None:
        titles = {f"{path.stem}_{part}.png": title for part, title in _TITLES.items()}
        left_out = (*notes, *no_pictures(path.parent, path.stem, titles))
        section = _section(content, verification.name, pictures(path.parent, path.stem, titles), left_out)
        return replace(section, commands=(command,))
    restored = restored_verification(content, arrays, result.robot)
    figures, missing = drawn(_figures(restored), prefix)
    logged = logged_instants(arrays, str(content["log"]["file"]), restored.equations)
    motion, unseen = played(logged, result.robot, result.task, looks)
    section = _section(content, verification.name, figures, (*notes, *unseen, *missing))
    return replace(section, commands=(command,), motion=motion)


def _result(folder: Path, content: Mapping[str, Any]) -> StoredResult | None:
    """The result that was verified, where the folder still has it."""
    try:
        result = load_result(folder)
    except InputError:
        return None
    return result if result.robot.sha256() == content["robot"]["sha256"] else None


def _section(
    content: Mapping[str, Any], title: str, figures: tuple[ReportFigure, ...], missing: tuple[str, ...]
) -> ReportSection:
    log, robot = content["log"], content["robot"]
    return ReportSection(
        kind="verification",
        title=title,
        verdict=content["verdict"],
        holds=bool(content["holds"]),
        asked=tuple((f"tolerance of the {key}", f"{100 * value:g} %") for key, value in content["tolerances"].items()),
        assumed=(*content["remarks"], *log["notes"]),
        notes=(*content["against"], *missing),
        tables=(_errors(content), _torques(content), *_motions(content)),
        figures=figures,
        facts=facts({}, robot=robot["name"], robot_sha256=robot["sha256"], log=log["file"], log_sha256=log["sha256"]),
    )


def _figures(verification: Verification) -> dict[str, Callable[[], Figure]]:
    from excite.plots import error_parts_figure, predicted_torques_figure, simulated_motion_figure

    figures = {_TITLES["torques"]: partial(predicted_torques_figure, verification)}
    if verification.replay is not None:
        figures[_TITLES["motion"]] = partial(simulated_motion_figure, verification)
    return {**figures, _TITLES["parts"]: partial(error_parts_figure, verification)}


def _errors(content: Mapping[str, Any]) -> ReportTable:
    errors = {
        "on this log": content["relative_error"],
        "on this log, without the noise of the measurement": content.get("corrected_error"),
        "on the logs of the identification": content.get("training_error"),
    }
    rows = tuple((ReportCell(name), percent(value)) for name, value in errors.items())
    return ReportTable("Error of the predicted torques over all equations", ("", "relative error"), rows, name="errors")


def _torques(content: Mapping[str, Any]) -> ReportTable:
    columns = ("equation", "measured", "error", "unit", "relative", "worst", "at [s]", "limited by")
    rows = tuple(
        (
            ReportCell(t["name"]), number(t["measured"]), number(t["error"]), unit(t["unit"]),
            percent(t["relative"]), number(t["worst"]), number(t["worst_time"]), ReportCell(str(t["limited_by"])),
        )
        for t in content["torques"]
    )  # fmt: skip
    return ReportTable("Predicted against measured", columns, rows, name="torques")


def _motions(content: Mapping[str, Any]) -> tuple[ReportTable, ...]:
    if content["motions"] is None:
        return ()
    columns = ("joint", "travel", "error", "unit", "relative", "worst", "at [s]")
    rows = tuple(
        (
            ReportCell(m["name"]), number(m["travel"]), number(m["error"]), unit(m["unit"]),
            percent(m["relative"]), number(m["worst"]), number(m["worst_time"]),
        )
        for m in content["motions"]
    )  # fmt: skip
    return (ReportTable("Simulated against measured motion", columns, rows, name="motions"),)
