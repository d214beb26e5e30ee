"""Motions of families read back from files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from excite.registry import BUILT_IN, OwnPart, built_in
from excite.trajectories.family import Family, Trajectory
from regressors.errors import UnknownName


def stored_trajectory(series: Mapping[str, Any], joints: int, family: Family | None = None) -> Trajectory:
    """Motion from the entries of a design's file."""
    name = str(series.get("family", "fourier"))
    if family is None:
        if ":" in name:
            raise OwnPart("trajectory", name).missing()
        if name not in BUILT_IN["trajectory"]:
            raise UnknownName("trajectory family", name, BUILT_IN["trajectory"])
        kind = built_in("trajectory", name)
        family = kind(series["period"], *(series[option] for option in kind.options))
    return family.stored(series, joints)
