"""An identification from the command line: reading, identifying, writing."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import excite
from excite.cli.interrupts import one_interrupt
from excite.cli.literal_console import console
from excite.cli.main import NOT_HELD
from excite.cli.messages import in_options
from excite.cli.options import FigureChoice
from excite.cli.sign_of_life import tell
from excite.cli.streams import remark
from excite.cli.summary import show
from excite.cli.view_text import print_view, view_summary
from excite.design.design_json import find_design
from excite.identification.recipe import Recipe, not_repeated
from excite.identification.result_json import CURVES, FIGURES, REPETITIONS, check_free, result_content
from excite.logs.mapping import read_mapping
from excite.registry import CHOSEN, is_own
from excite.storage.result_folder import figure_names, result_folder
from excite.views.identification_view import identification_view

_LEFT_OUT = (
    "schema", "robot", "task", "measured_condition_number", "motor_sides", "curves", "scatter", "scale", "calibration",
    "noise_deviations", "reference_values",
)  # fmt: skip
_KEPT = {"degrees_of_freedom", "unseen", "notes", "standard", "noise"}  # of the estimate
_GIVEN = (
    "base_link", "tip", "snap_angles", "xacro", "friction_curves", "mapping", "drop", "loaded", "known_mass", "gains",
    "each", "seed",
)  # fmt: skip
_NOT_REPEATED = ("estimator", "standstill", "signals")


def identify_and_write(
    name: str,
    paths: Sequence[Path],
    out: Path,
    typed: Mapping[str, Any],
    of_recipe: Mapping[str, Any],
    given: Mapping[str, Any],
) -> None:
    """Identify from logs and write a result's folder."""
    if given["repeat"]:
        Recipe(**of_recipe).check_repeatable(given["repeat"])
    tell("reading the logs")
    with result_folder(out):
        figures: FigureChoice = given["figures"]
        check_free(out, (*figure_names(FIGURES, figures.formats), CURVES), replace=given["force"])
        with one_interrupt() as interruption:
            result = _identified(name, paths, typed, of_recipe, given)
            interruption.ignore()
            files = result.save(out, replace=given["force"])
            files = [*figures.write(result, out), *files]
        status = NOT_HELD if result.doubts else 0
        if given["repeat"]:
            tell("repeating the experiment in simulation")
            where = {"executor": given["executor"], "workers": given["workers"]}
            from excite.cli.repetition_run import repeat_and_write  # imports jax

            result, repeated = repeat_and_write(result, out, given["repeat"], given["seed"], figures, **where)
            status = repeated or status
            drawn = figure_names([REPETITIONS], figures.formats) if result.repetitions is not None else []
            files = [*(out / name for name in drawn), *files]
    show_result(result, files, out)
    sys.exit(status)


def show_result(result: excite.Identification, files: Sequence[Path], out: Path) -> None:
    """Print a result: reasons against it, its view, and what to do next: the cures of doubts, or else to verify."""
    view = identification_view(result)
    cures = dict.fromkeys(in_options(doubt.cure) for doubt in result.doubts)
    steps = list(cures) or [f"excite verify {files[-1].parent} OTHER.csv, with a log that was not used here"]
    summary = view_summary(view, files, steps, "result.json")
    summary = replace(summary, holds=not result.doubts, facts=[*view.against, *summary.facts])

    def details() -> None:
        for text in view.against:
            console().print(in_options(text), style="bold", soft_wrap=True)
        print_view(view, files, steps)

    show(summary, lambda: _shown(result, out), details)


def _shown(result: excite.Identification, out: Path) -> dict[str, Any]:
    """What ``--json`` prints: the file without what stands there twice, and without the robot and the task."""
    left_out = {*_LEFT_OUT, *(field.name for field in fields(result.estimate))} - _KEPT
    return {"out": str(out), **{k: v for k, v in result_content(result).items() if k not in left_out}}


def _identified(
    name: str,
    paths: Sequence[Path],
    typed: Mapping[str, Any],
    of_recipe: Mapping[str, Any],
    given: Mapping[str, Any],
) -> excite.Identification:
    own = {"model": typed["model"]} if is_own(typed.get("model", "")) else {}
    folder = design_folder(given["design_folder"], given["mapping"], given["designs"])
    design = None if folder is None else excite.load_design(folder, given["parts"], **own)
    repeat, choose = bool(given["repeat"]), given["choose"]
    if repeat and given["friction_curves"] is not None:
        raise not_repeated()
    if design is not None and given["friction_curves"] is None and _has_curves(design, typed):
        remark(
            "excite: note: the design is for known friction: its curves are subtracted; --friction identifies "
            "friction, --friction-curves names other curves"
        )
        if repeat:
            raise not_repeated()
    if repeat:  # not what cannot be repeated
        names = (CHOSEN if choose else ()) if isinstance(choose, bool) else choose
        choose = tuple(each for each in names if each not in _NOT_REPEATED)
    return excite.identify(
        name, list(paths), design=design, choose=choose, progress=tell, **{name: given[name] for name in _GIVEN},
        **typed, **of_recipe,
    )  # fmt: skip


def _has_curves(design: Any, typed: Mapping[str, Any]) -> bool:
    """Whether the friction curves of the design are subtracted."""
    if design.task.known_friction is None or typed.get("friction", False):
        return False
    named = {"model": typed["model"]} if "model" in typed else {}
    return bool(design.task.changed(**named, friction_curves=None).model.channel == "effort")


_DESIGNS = Path("designs")


def design_folder(given: Path | None, mapping: Path | None, places: Sequence[Path]) -> Path | None:
    """Folder of the design that was played."""
    named = None if mapping is None or given is not None else read_mapping(mapping).design
    if mapping is None or named is None:
        return given
    searched = tuple(places) or (mapping.parent, _DESIGNS)
    found = find_design(named, searched)
    where = ", ".join(str(place) for place in searched)
    if found is None:
        remark(
            f"excite: note: {mapping} names the design {named[:12]}..., which is not in {where} nor directly below: "
            "its model is not used; --designs names other folders, --design the design itself"
        )
    else:
        remark(f"excite: note: {found} holds the design that {mapping} names; its model is used")
    return found
