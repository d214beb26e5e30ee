"""Execution of ``excite study``, ``excite predict`` and ``excite bound``: what experiments and designs can reach."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import excite
from excite.cli.options import FigureChoice
from excite.cli.sign_of_life import tell
from excite.cli.view_text import brief_table, show_view
from excite.optimality.design_bound import NAME, stored_bound
from excite.optimality.sensitivity import sensitivity
from excite.storage.records import json_of
from excite.storage.result_folder import figure_names, result_folder
from excite.study.time_study import FIGURE, check_free
from excite.views.accuracy_view import accuracy_view
from excite.views.bound_view import bound_view
from excite.views.study_view import study_view

_PARAMETERS, _CHANGES = 12, 5  # rows of a summary


def study_and_write(
    robot: str,
    logs: Sequence[Path],
    out: Path,
    *,
    designs: Sequence[Path],
    parts: tuple[str, ...],
    figures: FigureChoice,
    force: bool,
    **given: Any,
) -> None:
    """Follow the estimates of logs and designs over time, and write them."""
    simulation = {name: given.pop(name) for name in ("rate", "encoder", "torque_noise", "seed")}
    with result_folder(out):
        check_free(out, figure_names([FIGURE], figures.formats), replace=force)
        study = excite.study_over_time(
            robot,
            logs,
            designs=[excite.load_design(folder, parts) for folder in designs],
            simulation=simulation,
            progress=tell,
            **{name: value for name, value in given.items() if value is not None},
        )
        files = [*study.save(out, replace=force), *figures.write(study, out)]
    view = study_view(study)
    show_view(view, files, content=lambda: json_of(study), facts=brief_table(view.tables[0]), all_in="study.json")


def predict_and_write(folder: Path, parts: tuple[str, ...], given: Mapping[str, Any]) -> None:
    """Predict what repeats of an experiment will show, and write it beside the design."""
    design = excite.load_design(folder, parts)
    prediction = excite.predict_accuracy(design, progress=tell, **given)
    files = prediction.save(_place(folder))
    view = accuracy_view(prediction)
    facts = [*view.summary, *brief_table(view.tables[0], most=_PARAMETERS)]
    show_view(view, files, content=lambda: json_of(prediction), facts=facts, all_in=files[0].name)


def bound_and_write(folder: Path, wanted: tuple[str, ...], seed: int, parts: tuple[str, ...], *, force: bool) -> None:
    """Bound the criteria of a design, or read what was computed of the same problem before."""
    design = excite.load_design(folder, parts)
    known = None if force else stored_bound(design)
    files: list[Path] = []
    if known is not None and {each.name for each in known.criteria} >= set(wanted):
        result = known
        if known.sensitivity is None:
            result = replace(known, sensitivity=sensitivity(design, tell))
            files = result.save(_place(folder))
    else:
        result = excite.bound(design, wanted, seed=seed, progress=tell)
        others = () if known is None else (each for each in known.criteria if each.name not in wanted)
        result = replace(result, criteria=(*result.criteria, *others))
        files = result.save(_place(folder))
    view = bound_view(result)
    criteria, *changes = view.tables
    show_view(
        view,
        files,
        content=lambda: json_of(result),
        facts=[
            view.summary[0],
            *brief_table(criteria),
            *(each for table in changes for each in brief_table(table, most=_CHANGES)),
            *view.summary[1:],
        ],
        notes=[*([] if files else [f"read from {NAME}; --force computes it again"]), *view.remarks],
    )


def _place(folder: Path) -> Path:
    """The folder of a design that may be named by its file."""
    return folder.parent if folder.suffix == ".json" else folder
