"""Execution of ``excite friction fit``, and the summary of the curves."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import excite
from excite.cli.literal_console import console
from excite.cli.options import robot_file_of
from excite.cli.sign_of_life import tell
from excite.cli.summary import Summary, show
from excite.cli.task_options import chosen_of
from excite.cli.view_text import brief_table, print_view
from excite.friction.fit.fit_settings import FitSettings
from excite.friction.fit.friction_fit import FIGURE, FRICTION, check_no_fit
from excite.storage.figure_names import figure_names
from excite.storage.records import json_of
from excite.storage.result_folder import result_folder
from excite.tasks.robot_of_task import installed_robot
from excite.views.friction_fit_view import friction_fit_view


def fit_and_write(name: str, paths: Sequence[Path], out: Path, given: dict[str, Any]) -> None:
    """Fit curves to logs and write their folder."""
    settings = FitSettings(**chosen_of(FitSettings, given))
    tell("reading the logs")
    with result_folder(out):
        check_no_fit(out, (FRICTION, *figure_names([FIGURE], given["figures"].formats)), replace=given["force"])
        task = excite.Task(name, **robot_file_of(given), mount=given["mount"], payload=given["payload"])
        robot = installed_robot(task)
        asked = {key: given[key] for key in ("plan", "drives", "mapping", "drop")}
        if given["parameters"] is not None:
            own = given["parts"]
            asked["parameters"] = excite.load_result(given["parameters"], own) if own else given["parameters"]
        fit = excite.fit_friction(robot, list(paths), settings, progress=tell, **asked)
        files = fit.save(out, replace=given["force"])
        if figures := given["figures"]:
            from excite.plots.friction_plot import write_friction_figure

            tell("drawing")
            files = [*write_friction_figure(fit.robot, fit.characteristics, out, **figures.how), *files]
    show(
        _summary(fit, files),
        lambda: {"out": str(out), **json_of(fit)},
        lambda: _print(fit, files),
    )


def _summary(fit: excite.FrictionFit, files: Sequence[Path]) -> Summary:
    view = friction_fit_view(fit)
    return Summary(
        verdict=view.verdict,
        facts=[*brief_table(view.tables[0], left=2), *view.summary],
        notes=[*view.remarks, "friction of other drives is identified with the masses"],
        files=files,
        next_steps=[f"excite identify ROBOT LOG... --friction-curves {files[-1].parent / FRICTION} --out DIR"],
        all_in="fit.json",
    )


def _print(fit: excite.FrictionFit, files: Sequence[Path]) -> None:
    print_view(friction_fit_view(fit))
    drives = ", ".join(characteristic.drive for characteristic in fit.characteristics)
    console().print(
        f"note: {FRICTION} has curves of {drives}; friction of other drives is identified with the masses",
        soft_wrap=True,
    )
    console().print("written: " + ", ".join(map(str, files)), soft_wrap=True)
