"""Execution of ``excite identify``: read files, estimate, write files."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import excite
from excite.cli.design_of_mapping import design_folder
from excite.cli.estimate_text import estimate_summary, print_estimate
from excite.cli.figure_options import FigureChoice
from excite.cli.interrupts import one_interrupt
from excite.cli.repetition_text import print_repetitions, repeat_and_write
from excite.cli.sign_of_life import tell
from excite.cli.streams import remark
from excite.cli.summary import show
from excite.files.result_curves import CURVES
from excite.files.result_json import FIGURES, REPETITIONS, check_free, result_content
from excite.identification.recipe import Recipe, not_repeated
from excite.registry import CHOSEN, is_own
from excite.storage.figure_names import figure_names
from excite.storage.result_folder import result_folder

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
        content = result_content(result)
        status = NOT_HELD if content["doubts"] else 0
        if given["repeat"]:
            tell("repeating the experiment in simulation")
            where = {"executor": given["executor"], "workers": given["workers"]}
            content, repeated = repeat_and_write(result, out, content, given["repeat"], given["seed"], figures, **where)
            status = repeated or status
            drawn = figure_names([REPETITIONS], figures.formats) if "repetitions" in content else []
            files = [*(out / name for name in drawn), *files]
    left_out = ("schema", "robot", "covariance", "task")
    show(
        estimate_summary(content, files),
        lambda: {"out": str(out), **{k: v for k, v in content.items() if k not in left_out}},
        lambda: _print(content, files),
    )
    sys.exit(status)


def _print(content: dict[str, Any], files: Sequence[Path]) -> None:
    print_estimate(content, files)
    if "repetitions" in content:
        print_repetitions(content["repetitions"])


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
