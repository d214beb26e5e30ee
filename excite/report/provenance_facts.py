"""Where results come from: dates, versions, hashes and times, as names and values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from excite.report.sections import text_of

_NAMES = {"wall_seconds": "time taken [s]", "cpu_seconds": "processor time [s]", "problem": "hash of the problem"}
_LEFT_OUT = ("run",)


def facts(provenance: Mapping[str, Any], **hashes: Any) -> tuple[tuple[str, str], ...]:
    """Provenance of a result."""
    shown = {name.replace("_", " "): value for name, value in hashes.items() if value is not None}
    shown |= {_NAMES.get(name, name): value for name, value in provenance.items() if name not in _LEFT_OUT}
    return tuple((name, text_of(value)) for name, value in shown.items() if value not in (None, [], ()))
