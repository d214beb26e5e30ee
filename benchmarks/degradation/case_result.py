"""One case: plain defaults beside the best fixed choice in hindsight."""

from __future__ import annotations

import time
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from cases import CASES
from fixed_choices import best_fixed_choice
from subjects import TRAIN, UNSEEN, Measurement, measurement

import excite
from excite.identification.identification import Identification
from excite.verification.verification import Verification
from regressors.errors import ExciteError


def result_of(name: str, number: int) -> dict[str, Any]:
    """Errors of one robot in one case, and all that was said.

    Parameters
    ----------
    name : str
        Of the robot.
    number : int
        Of the case in `cases.CASES`.
    """
    case = CASES[number]
    train, unseen = (measurement(name, case, seed) for seed in (TRAIN, UNSEEN))
    begin = _clocks()
    default = _by_default(name, train, unseen)
    middle = _clocks()
    best, per_cutoff = best_fixed_choice(name, train, unseen)
    end = _clocks()
    return {
        "robot": name,
        "kind": case.kind,
        "level": case.level,
        "default": default,
        "best": asdict(best),
        "best_per_cutoff": [asdict(choice) for choice in per_cutoff],
        "default_seconds": _between(begin, middle),
        "fixed_seconds": _between(middle, end),
    }


def _clocks() -> tuple[float, float]:
    return time.process_time(), time.monotonic()


def _between(begin: tuple[float, float], end: tuple[float, float]) -> dict[str, float]:
    return {"cpu": round(end[0] - begin[0], 3), "wall": round(end[1] - begin[1], 3)}


def _by_default(name: str, train: Measurement, unseen: Measurement) -> dict[str, Any]:
    try:
        found = excite.identify(name, train.log)
        judged = excite.verify(found, replace(unseen.log, sha256=f"{unseen.log.sha256} unseen"))
    except ExciteError as error:
        return {"error": None, "true_error": None, "messages": [f"refused: {error}"], "against": [], "recipe": None}
    true = np.column_stack([np.interp(judged.time, unseen.time, column) for column in unseen.effort.T])
    return {
        "error": float(judged.relative_error),
        "true_error": float(np.linalg.norm(judged.predicted - true) / np.linalg.norm(true)),
        "training_error": float(judged.training_error),
        "messages": _messages(found, judged),
        "against": list(judged.verdict.against),
        "recipe": found.recipe.to_dict(),
    }


def _messages(found: Identification, judged: Verification) -> list[str]:
    notes = [note for part in (*found.prepared, judged.log) for note in part.notes]
    return [*dict.fromkeys((*notes, *found.estimate.notes, *judged.verdict.against, *judged.verdict.remarks))]
