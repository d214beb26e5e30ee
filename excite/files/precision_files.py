"""``precision.json`` and ``precision.csv`` beside a design: periods that were tried, robot time against precision."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

from excite.design.design import Design
from excite.information.metrics import noise_per_row
from excite.storage.atomic import replacing, write_json
from excite.tasks.task import Task

SCHEMA = "excite.precision/1"
CONTENT, TABLE = "precision.json", "precision.csv"
FIGURE = "precision"
_HEAD = ("period", "runs", "robot_seconds", "largest_use")


def seeks_precision(task: Task) -> bool:
    """Whether a task asks for the shortest experiment that meets a precision, not for one motion at its period."""
    return task.objective.precision is not None and task.objective.scale != "precision"


def precision_content(design: Design) -> dict[str, Any]:
    """Content of ``precision.json``."""
    search, forecast, run = design.precision_search, design.precision, design.run_information
    assert search is not None
    assert forecast is not None
    assert run is not None
    return {
        "schema": SCHEMA,
        "asked": run.precision.to_dict(),
        "noise": noise_per_row(design.task.objective.noise, design.target.model).tolist(),
        "max_time": design.task.objective.max_time,
        "period": design.task.trajectory.period,
        **forecast.to_dict(),
        **search.to_dict(),
    }


def write_precision(design: Design, folder: Path) -> None:
    """Write both files of a design's search for a precision."""
    search = design.precision_search
    assert search is not None
    write_json(folder / CONTENT, precision_content(design))
    with replacing(folder / TABLE) as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(_HEAD)
        writer.writerows((repr(p.period), p.runs, repr(p.robot_seconds), repr(p.use)) for p in search.front)
