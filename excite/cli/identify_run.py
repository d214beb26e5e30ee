"""An identification from the command line: reading, identifying, writing."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import excite
from excite.cli.estimate_text import estimate_summary, print_estimate
from excite.cli.interrupts import one_interrupt
from excite.cli.options import FigureChoice
from excite.cli.repetition_text import repeat_and_write
from excite.cli.sign_of_life import tell
from excite.cli.streams import remark
from excite.cli.summary import show
from excite.files.named_design import find_design
from excite.files.result_json import CURVES, FIGURES, REPETITIONS, check_free, result_content
from excite.identification.recipe import Recipe, not_repeated
from excite.logs.mapping import read_mapping
from excite.registry import CHOSEN, is_own
from excite.storage.figure_names import figure_names
from excite.storage.result_folder import result_folder

_LEFT_OUT = (
    "schema", "robot", "task", "measured_condition_number", "motor_sides", "curves", "scatter", "scale", "calibration",
    "noise_deviations", "reference_values",
)  # fmt: skip
_KEPT = {"degrees_of_freedom", "unseen", "notes", "standard", "noise"}  # of the estimate
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
    from excite.cli.main import NOT_HELD

    tell("reading the logs")
    with result_folder(out):
        figures: FigureChoice = given["figures"]
        check_free(out, (*figure_names(FIGURES, figures.formats), CURVES), replace=given["force"])
        with one_interrupt() as interruption:
            result = _identified(name, paths, typed, of_recipe, given)
            interruption.ignore()
            files = result.save(out, replace=given["force"])
            if figures:
                from excite.plots import write_identification_figures

                tell("drawing")
                files = [*write_identification_figures(result, out, result.reference, **figures.how), *files]
        status = NOT_HELD if result.doubts else 0
        if given["repeat"]:
            tell("repeating the experiment in simulation")
            where = {"executor": given["executor"], "workers": given["workers"]}
            result, repeated = repeat_and_write(result, out, given["repeat"], given["seed"], figures, **where)
            status = repeated or status
            drawn = figure_names([REPETITIONS], figures.formats) if result.repetitions is not None else []
            files = [*(out / name for name in drawn), *files]
    show(estimate_summary(result, files), lambda: _shown(result, out), lambda: print_estimate(result, files))
    sys.exit(status)


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
    if design is not None and given["friction_curves"] is None:
        _tell_of_curves(design, typed, repeat=bool(given["repeat"]))
    elif given["repeat"] and given["friction_curves"] is not None:
        raise not_repeated()
    return excite.identify(
        name,
        list(paths),
        base_link=given["base_link"],
        tip=given["tip"],
        snap_angles=given["snap_angles"],
        xacro=given["xacro"],
        design=design,
        friction_curves=given["friction_curves"],
        choose=_to_choose(given["choose"], repeat=bool(given["repeat"])),
        mapping=given["mapping"],
        drop=given["drop"],
        loaded=list(given["loaded"]),
        known_mass=given["known_mass"],
        gains=given["gains"],
        each=given["each"],
        seed=given["seed"],
        progress=tell,
        **typed,
        **of_recipe,
    )


def _tell_of_curves(design: Any, typed: Mapping[str, Any], *, repeat: bool) -> None:
    """Print a note that the friction curves of the design are subtracted."""
    known = design.task.known_friction is not None and not typed.get("friction", False)
    if not known or design.task.changed(**_of_model(typed)).model.channel != "effort":
        return
    remark(
        "excite: note: the design is for known friction: its curves are subtracted; --friction identifies friction, "
        "--friction-curves names other curves"
    )
    if repeat:
        raise not_repeated()


def _to_choose(asked: bool | tuple[str, ...], *, repeat: bool) -> bool | tuple[str, ...]:
    """Settings to choose: with repetitions not what cannot be repeated."""
    if not repeat:
        return asked
    names = (CHOSEN if asked else ()) if isinstance(asked, bool) else asked
    return tuple(name for name in names if name not in _NOT_REPEATED)


def _of_model(typed: Mapping[str, Any]) -> dict[str, Any]:
    named = {"model": typed["model"]} if "model" in typed else {}
    return {**named, "friction_curves": None}


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
