"""Whether the design that is given is the one whose motion was recorded."""

from __future__ import annotations

from pathlib import Path

from excite.design.designed_motion import DesignedMotion
from excite.logs.mapping import LogMapping, read_mapping
from regressors.errors import InputError


def check_played(design: DesignedMotion | None, mapping: LogMapping | str | Path | None) -> None:
    """Refuse a design that is not the one that a log mapping names."""
    if design is None or mapping is None:
        return
    named = (read_mapping(mapping) if isinstance(mapping, str | Path) else mapping).design
    if named is not None and named not in (design.file_sha256, design.coefficients_sha256):
        raise InputError(
            f"the log mapping is of a recording of another design: it names the SHA-256 {named[:12]}..., and "
            f"{design.name} has {(design.file_sha256 or design.coefficients_sha256)[:12]}...; give the `design` "
            "that was played, or the mapping that was written with this one"
        )
