"""The section of a verification."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from excite.files.stored import complete, stored_content
from excite.files.verification_json import SCHEMA, verification_content
from excite.report.drawings import drawn, no_pictures, pictures
from excite.report.provenance_facts import facts
from excite.report.sections import ReportCell, ReportFigure, ReportSection, ReportTable, number, percent, unit
from excite.storage.commit import read_settled
from excite.storage.destination import Destination
from excite.storage.manifest import check_files
from excite.verification.verification import Verification

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


def verification_section(verification: StoredVerification | Verification, prefix: str) -> ReportSection:
    """Everything that a page says of a verification.

    Parameters
    ----------
    verification : StoredVerification or Verification
    prefix : str
        Begins the identifiers of its figures.
    """
    if isinstance(verification, StoredVerification):
        content, path = verification.content, verification.path
        titles = {f"{path.stem}_{part}.png": title for part, title in _TITLES.items()}
        command = shlex.join(["excite", "verify", str(path.parent), str(content["log"]["file"])])
        figures, left_out = pictures(path.parent, path.stem, titles), no_pictures(path.parent, path.stem, titles)
        return _section(content, verification.name, figures, left_out, (command,))
    content = verification_content(verification)
    figures, missing = drawn(_figures(verification), prefix)
    return _section(content, f"verification on {content['log']['file']}", figures, missing, ())


def _section(
    content: Mapping[str, Any],
    title: str,
    figures: tuple[ReportFigure, ...],
    missing: tuple[str, ...],
    commands: tuple[str, ...],
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
        commands=commands,
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
