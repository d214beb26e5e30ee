"""Commands that repeat an identification, with the settings that were found, and verify it."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from typing import Any

from excite.files.task_file import task_content
from excite.identification.identification import Identification
from excite.identification.recipe import Recipe

_VALUES = (
    "rows", "signals", "cutoff", "period", "harmonics", "low_pass", "every", "standstill", "estimator", "covariance",
    "pull", "described_within", "delay", "temperature",
)  # fmt: skip
_FLAGS = {"average": "--average", "measured_velocity": "--measured-velocity", "friction_scale": "--scale-friction"}


def commands_of(result: Identification, folder: str) -> tuple[str, ...]:
    """Commands that identify from the same logs, and verify."""
    task, provenance = task_content(result.task), result.provenance
    design = None if result.design is None else result.design.folder
    words = ["excite", "identify", str(task["robot"]), *result.log_names]
    words += ["--design", str(design)] if design else _model(task)
    words += ["--mapping", str(provenance["mapping"])] if provenance.get("mapping") else []
    words += [word for name in provenance.get("drop") or () for word in ("--drop", str(name))]
    again = [*words, *_recipe(result.recipe.to_dict()), "--choose", "none", "--out", f"{folder}-again"]
    return shlex.join(again), shlex.join(["excite", "verify", folder, "OTHER.csv"])


def _model(task: Mapping[str, Any]) -> list[str]:
    """Options of the model, where no design gives them."""
    chain = [(f"--{name.replace('_', '-')}", task.get(name)) for name in ("base_link", "tip", "model")]
    words = [word for flag, value in chain if value is not None for word in (flag, str(value))]
    words += ["--joints", ",".join(map(str, task["joints"]))] if task.get("joints") else []
    return [*words, *("--no-" + name for name in ("friction", "rotor") if task.get(name) is False)]


def _recipe(recipe: Mapping[str, Any]) -> list[str]:
    """Settings that are not the defaults, with all digits."""
    default = Recipe().to_dict()
    values = {name: recipe.get(name) for name in _VALUES if recipe.get(name) != default.get(name)}
    slope = "breakaway" if recipe.get("breakaway") else "sign_width"  # one of them decides where friction turns
    values[slope] = recipe.get(slope)
    words = [
        word
        for name, value in values.items()
        if value is not None
        for word in (f"--{name.replace('_', '-')}", _text(value))
    ]
    return [*words, *(flag for name, flag in _FLAGS.items() if recipe.get(name))]


def _text(value: Any) -> str:
    return ",".join(map(_text, value)) if isinstance(value, list | tuple) else str(value)
