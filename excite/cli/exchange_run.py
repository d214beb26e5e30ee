"""Execution of ``excite export`` and ``report``: what is written for others."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

import excite
from excite.cli.main import NOT_HELD
from excite.cli.options import check_not_typed, chosen_of
from excite.cli.progress import interrupted_status, progress_of_samples, stoppable
from excite.cli.streams import in_options, tell
from excite.cli.summary import show
from excite.export.exported import Exported
from excite.registry import MODEL_FORMATS, MOTION_FORMATS, built_in
from excite.tasks.further_settings import EnsembleSettings
from excite.views.view import View, ViewTable, text_of, texts

_DESIGN, _RESULT, _SERVOS = "design.json", "result.json", "servos.json"


def export_and_show(folder: Path, form: str, out: Path, **given: Any) -> None:
    """Export a design or a result, and end with the exit status."""
    if given["samples"] is None:
        check_not_typed(("seed", "level", "prior"), "is of an ensemble: give the number of its robots, --samples N")
    exported = (_model if _holds_result(folder, form) else _motion)(folder, form, out, given)
    _show(exported)
    sys.exit(interrupted_status() if exported.facts.get("interrupted") else 0 if exported.holds else NOT_HELD)


def _holds_result(folder: Path, form: str) -> bool:
    """Whether a result or servos are meant, and not a design."""
    if folder.suffix == ".json":
        return folder.name in (_RESULT, _SERVOS)
    design, *results = ((folder / name).exists() for name in (_DESIGN, _RESULT, _SERVOS))
    if all(results) and form in MODEL_FORMATS:
        raise click.UsageError(f"{folder} holds a result and servos: name {folder / _RESULT} or {folder / _SERVOS}")
    result = any(results)
    if design and result and form in MOTION_FORMATS and form in MODEL_FORMATS:
        raise click.UsageError(
            f"{folder} holds a design and a result, and {form} is a format of both: name {folder / _DESIGN} or "
            f"{folder / (_RESULT if results[0] else _SERVOS)}"
        )
    return result and (not design or form in MODEL_FORMATS)


def _motion(folder: Path, form: str, out: Path, given: Mapping[str, Any]) -> Any:
    for name, of in (("samples", "robots"), ("robot_file", "model")):
        if given[name] is not None:
            raise click.UsageError(f"--{name.replace('_', '-')} is for the {of} of a result, and DIR holds a design")
    if form in MODEL_FORMATS and form not in MOTION_FORMATS and (folder / _DESIGN).exists():
        raise click.UsageError(
            f"{form} is a format of models, and {folder} holds a design: identify with it and export the result, or "
            f"choose {', '.join(MOTION_FORMATS)}"
        )
    design = excite.load_design(folder, given["parts"])
    return built_in("exporter", "motion")(design, form, out, rate=given["rate"], replace=given["force"])


def _model(folder: Path, form: str, out: Path, given: Mapping[str, Any]) -> Any:
    if form not in MODEL_FORMATS and form in MOTION_FORMATS:
        raise click.UsageError(
            f"{form} is a format of motions, and {folder} holds a result: export its design, or choose "
            f"{', '.join(MODEL_FORMATS)}"
        )
    if given["rate"] is not None:
        raise click.UsageError("--rate is for the motion of a design, and DIR holds a result")
    servos = folder.name == _SERVOS or (folder / _SERVOS).exists()
    if servos and given["samples"] is not None:
        raise click.UsageError("--samples is for the result of torques, and DIR holds servos")
    result = folder if servos else excite.load_result(folder, given["parts"])
    shared = {"robot_file": given["robot_file"], "replace": given["force"]}
    if given["samples"] is None:
        return built_in("exporter", "model")(result, form, out, **shared)
    with stoppable(progress_of_samples("exported"), "stopping after the robot at work") as report:
        asked = chosen_of(given, EnsembleSettings)
        return built_in("exporter", "ensemble")(result, form, out, progress=report, **shared, **asked)


def _show(exported: Exported) -> None:
    def content() -> dict[str, Any]:
        notes = [in_options(note) for note in exported.notes]
        files = [str(file) for file in exported.files]
        return {"format": exported.format, "files": files, **exported.facts, "notes": notes}

    facts = tuple((name.replace("_", " "), text_of(value)) for name, value in exported.facts.items())
    moves = {"rate", "samples", "duration", "joints"} <= exported.facts.keys()
    view = View(
        title=str(exported.files[0]),
        verdict=_verdict(exported),
        holds=exported.holds,
        summary=(_played(exported),) if moves else tuple(map(": ".join, facts)),
        remarks=exported.notes,
        tables=(ViewTable("facts", "What was written", texts("", "value"), facts),) if moves else (),
    )
    show(view, exported.files, content=content)


def _verdict(exported: Exported) -> str:
    """What was written, and, of a motion, how near it comes to its limits."""
    facts = exported.facts
    if "robots" in facts:
        ended = ", interrupted" if facts.get("interrupted") else ""
        return f"Ensemble of {facts['robots']} possible robots exported as {exported.format}{ended}"
    if "servos" in facts:
        return f"{len(facts['servos'])} servos exported as {exported.format}"
    if "closest_limit" not in facts:
        return f"Model exported as {exported.format}"
    label, used = facts["closest_limit"], facts["closest_limit_used"]
    if label is None:
        return f"Motion exported as {exported.format}; no limit of the robot is known"
    if not facts["limits_kept"]:
        return f"Motion exported as {exported.format}; between its samples the limits are {facts['between_samples']}"
    return (
        f"Motion exported as {exported.format}, within its limits; the closest, {label}, is used to {100 * used:.4g} %"
    )


def _played(exported: Exported) -> str:
    """Rate and duration of a motion, in one line."""
    samples, rate, duration, joints = (exported.facts[name] for name in ("samples", "rate", "duration", "joints"))
    return f"{samples} samples at {rate:g} Hz over {duration:g} s; {', '.join(joints)}"


def write_page(paths: Sequence[Path], out: Path, robot_file: Path | None, parts: tuple[str, ...], force: bool) -> None:
    """Write a page on results."""
    tell("writing the page")
    page = excite.write_report(paths, out, replace=force, robot_file=robot_file, part=parts)
    size = page.stat().st_size
    view = View("page", f"Page written: {page} ({size / 1e6:.2f} MB); open it in a browser")
    show(view, content=lambda: {"out": str(page), "bytes": size})
