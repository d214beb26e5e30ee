"""Groups of columns whose names say nothing, found by their numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from excite.logs.guess.channel_group import ChannelGroup
from excite.logs.guess.clock_choice import Clock
from excite.logs.guess.motion_pairs import motion_columns
from excite.logs.recordings.recording import Contents, Recording
from regressors.samples import Array


def numbered_groups(
    contents: Contents, recording: Recording, clocks: Mapping[str, Clock], joints: int | None
) -> list[ChannelGroup]:
    """Positions and velocities of each stream by their agreement, and blocks of as many columns beside them."""
    groups = []
    for stream in contents.streams:
        clock = clocks.get(stream.name)
        if clock is None or stream.name not in recording.streams:
            continue
        columns = recording.streams[stream.name].columns
        names = [name for name in stream.columns if name in columns]
        values = np.column_stack([np.asarray(columns[name], dtype=float) for name in names])
        groups += _of_stream(stream.name, names, values, names.index(clock.column), joints)
    return groups


def _of_stream(stream: str, names: list[str], values: Array, clock: int, joints: int | None) -> list[ChannelGroup]:
    whole = values[np.isfinite(values).all(axis=1)]
    if whole.shape[0] < 100:
        return []
    found = motion_columns(whole[:, clock], whole, clock)
    if found is None:
        return []
    n = min(joints or len(found.positions), len(found.positions))
    labels = tuple(f"{k}" for k in range(1, n + 1))
    seen = "" if found.seen >= n else f", as {found.seen} of them show{'s' * (found.seen == 1)} that moved"
    any_of = ChannelGroup("", stream, labels, labels, common=("#",), how="by their place")
    positions, velocities = (tuple(names[k] for k in some[:n]) for some in (found.positions, found.velocities))
    why = f"since other columns are their rate of change{seen}"
    groups = [
        replace(any_of, quantity="position", columns=positions, how=why, guessed=found.seen < n),
        replace(any_of, quantity="velocity", columns=velocities, how="since they are their rate of change"),
    ]
    free = [k for k in range(len(names)) if k > max(found.velocities) and k != clock]
    for first in range(0, len(free) - n + 1, n):
        groups.append(replace(any_of, columns=tuple(names[k] for k in free[first : first + n])))
    return groups
