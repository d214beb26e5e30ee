"""Execution of ``excite export``: find the exporter that is meant, and summarise what it wrote."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

import excite
from excite.cli.interrupts import deferred_interrupt, interrupted_status
from excite.cli.messages import in_options
from excite.cli.progress import progress_of_samples
from excite.cli.summary import Summary, show
from excite.cli.task_options import chosen_of
from excite.registry import MODEL_FORMATS, MOTION_FORMATS, built_in
from excite.tasks.further_settings import EnsembleSettings

_DESIGN, _RESULT = "design.json", "result.json"


def export(folder: Path, form: str, out: Path, given: Mapping[str, Any]) -> None:
    """Export a design or a result, and end with the exit status."""
    exported = (_model if _holds_result(folder, form) else _motion)(folder, form, out, given)
    _show(exported)
    if exported.facts.get("interrupted"):
        sys.exit(interrupted_status())
    if not exported.holds:
        sys.exit(1)


def _holds_result(folder: Path, form: str) -> bool:
    """Whether a result is meant, and not a design."""
    if folder.suffix == ".json":
        return folder.name == _RESULT
    design, result = ((folder / name).exists() for name in (_DESIGN, _RESULT))
    if design and result and form in MOTION_FORMATS and form in MODEL_FORMATS:
        raise click.UsageError(
            f"{folder} holds a design and a result, and {form} is a format of both: name {folder / _DESIGN} or "
            f"{folder / _RESULT}"
        )
    return result and (not design or form in MODEL_FORMATS)


def _motion(folder: Path, form: str, out: Path, given: Mapping[str, Any]) -> excite.Exported:
    for name, of in (("samples", "robots"), ("robot_file", "model")):
        if given[name] is not None:
            raise click.UsageError(f"--{name.replace('_', '-')} is for the {of} of a result, and DIR holds a design")
    if form in MODEL_FORMATS and form not in MOTION_FORMATS and (folder / _DESIGN).exists():
        raise click.UsageError(
            f"{form} is a format of models, and {folder} holds a design: identify with it and export the result, or "
            f"choose {', '.join(MOTION_FORMATS)}"
        )
    design = excite.load_design(folder, given["parts"])
    exported: excite.Exported = built_in("exporter", "motion")(
        design, form, out, rate=given["rate"], replace=given["force"]
    )
    return exported


def _model(folder: Path, form: str, out: Path, given: Mapping[str, Any]) -> excite.Exported:
    if form not in MODEL_FORMATS and form in MOTION_FORMATS:
        raise click.UsageError(
            f"{form} is a format of motions, and {folder} holds a result: export its design, or choose "
            f"{', '.join(MODEL_FORMATS)}"
        )
    if given["rate"] is not None:
        raise click.UsageError("--rate is for the motion of a design, and DIR holds a result")
    result = excite.load_result(folder, given["parts"]) if given["parts"] else excite.load_result(folder)
    shared = {"robot_file": given["robot_file"], "replace": given["force"]}
    exported: excite.Exported
    if given["samples"] is None:
        exported = built_in("exporter", "model")(result, form, out, **shared)
        return exported
    with deferred_interrupt("stopping after the robot at work") as answer, progress_of_samples("exported") as progress:

        def report(done: int, total: int) -> None:
            progress(done, total)
            if done < total:
                answer()

        asked = chosen_of(EnsembleSettings, given)
        exported = built_in("exporter", "ensemble")(result, form, out, progress=report, **shared, **asked)
    return exported


def _show(exported: excite.Exported) -> None:
    def content() -> dict[str, Any]:
        notes = [in_options(note) for note in exported.notes]
        files = [str(file) for file in exported.files]
        return {"format": exported.format, "files": files, **exported.facts, "notes": notes}

    def details() -> None:
        for line in (*_facts(exported), *(f"note: {in_options(note)}" for note in exported.notes)):
            click.echo(line)
        click.echo(f"written: {_listed(exported)}")

    show(
        Summary(
            verdict=_verdict(exported),
            holds=exported.holds,
            facts=_played(exported),
            notes=exported.notes,
            files=exported.files,
        ),
        content,
        details,
    )


def _listed(exported: excite.Exported) -> str:
    """The files; of an ensemble its folder and how many."""
    if "robots" not in exported.facts:
        return ", ".join(map(str, exported.files))
    return f"{exported.files[0].parent}: {len(exported.files)} files"


def _verdict(exported: excite.Exported) -> str:
    """What was written, and, of a motion, how near it comes to its limits."""
    facts = exported.facts
    if "robots" in facts:
        ended = ", interrupted" if facts.get("interrupted") else ""
        return f"Ensemble of {facts['robots']} possible robots exported as {exported.format}{ended}"
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


def _played(exported: excite.Exported) -> list[str]:
    """Rate and duration of a motion, in one line."""
    facts = exported.facts
    if not {"rate", "samples", "duration", "joints"} <= facts.keys():
        return _facts(exported)
    return [
        f"{facts['samples']} samples at {facts['rate']:g} Hz over {facts['duration']:g} s; {', '.join(facts['joints'])}"
    ]


def _facts(exported: excite.Exported) -> list[str]:
    """Facts with their numbers rounded."""
    return [f"{name.replace('_', ' ')}: {_shown(value)}" for name, value in exported.facts.items()]


def _shown(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(map(_shown, value)) or "none"
    if isinstance(value, float):
        return f"{value:.4g}"
    return "-" if value is None else str(value)
