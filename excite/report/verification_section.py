"""The section of a verification."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np

from excite.report.drawings import drawn, no_pictures, pictures
from excite.report.player_log import Appearance, LoggedMotion, played
from excite.report.sections import ReportSection
from excite.report.view_section import section_of
from excite.tasks.stored_files import StoredRobot
from excite.tasks.task import Task
from excite.verification.verification import Verification
from excite.views.verification_view import TITLES, verification_view


def verification_section(
    verification: Verification, prefix: str, looks: Appearance, path: Path | None = None
) -> ReportSection:
    """Everything that a page says of a verification."""
    v, view = verification, verification_view(verification)
    if len(v.time) and v.robot is not None:
        figures, missing = drawn(view.figures, prefix)
        motion, unseen = played(_logged(v), v.robot, Task(StoredRobot(v.robot.name, v.robot)), looks)
        part = (f"figures of the logs show every {v.step}th instant; the tables are of all of them",) * (v.step > 1)
        section = replace(section_of(view, "verification", figures, (*part, *unseen, *missing)), motion=motion)
    elif path is None:
        section = section_of(view, "verification", ())
    else:
        titles = {f"{path.stem}_{ending}.png": title for ending, title in TITLES.items()}
        gone = (
            "figures are the pictures in the folder, and the motion does not play: the file of curves, or the result "
            "that was verified, is not there",
            *no_pictures(path.parent, path.stem, titles),
        )
        section = section_of(view, "verification", pictures(path.parent, path.stem, titles), gone)
    if path is None:
        return section
    return replace(section, title=str(path), commands=(shlex.join(["excite", "verify", str(path.parent), v.log.file]),))


def _logged(v: Verification) -> LoggedMotion:
    """The measured motion, and the rows of each equation."""
    first = np.zeros(len(v.time), dtype=int)
    rows = tuple((first, v.time, v.measured[:, j], v.predicted[:, j]) for j in range(len(v.equations)))
    motion = v.motion
    return LoggedMotion(
        motion.joints, (v.log.file,), motion.time, np.zeros(len(motion.time), dtype=int), motion.q, v.equations, rows
    )
