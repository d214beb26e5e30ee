"""Estimates of several logs, and the scatter between them, as part of ``result.json``."""

from __future__ import annotations

import math
from typing import Any

from excite.identification.between_logs import scatter_warning
from excite.identification.identification import Identification
from excite.identification.interval_scope import interval_scope


def between_logs_content(result: Identification) -> dict[str, Any]:
    """Keys ``interval_scope`` and, of several logs, ``between_logs``, with the estimates of each where asked for."""
    scope = {"interval_scope": interval_scope(len(result.prepared))}
    scatter = result.scatter
    if scatter is None:
        return scope
    each = scatter.each
    parameters = [
        {
            "name": name,
            "unit": each.units[j],
            "logs": int(scatter.counts[j]),
            "ratio": _finite(math.sqrt(scatter.ratios[j])),
            "probability": _finite(scatter.probabilities[j]),
            **({"each": _of_logs(result, j)} if result.each else {}),
        }
        for j, name in enumerate(each.names)
    ]
    between = {
        "logs": list(each.logs),
        "convention": "ratio: scatter between logs over what the noise of each explains; Welch's test",
        "rms_ratio": _finite(scatter.rms),
        "exceeding": list(scatter.exceeding),
        "warning": scatter_warning(scatter),
        "parameters": parameters,
    }
    return {**scope, "between_logs": between}


def _of_logs(result: Identification, j: int) -> list[dict[str, Any]]:
    assert result.scatter is not None
    each = result.scatter.each
    return [
        {"log": log, "value": _finite(each.values[k, j]), "standard_deviation": _finite(each.deviations[k, j])}
        for k, log in enumerate(each.logs)
    ]


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
