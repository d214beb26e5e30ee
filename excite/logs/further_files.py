"""Signals of a log that are in files of their own, at their own instants."""

from __future__ import annotations

from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from excite.logs.event import DROPPED
from excite.logs.gaps import STEPS
from excite.logs.log import Log
from excite.logs.mapping import LogMapping
from excite.logs.recordings.formats import binary_format, recording_sha256
from excite.logs.sampled_channels import SampledChannels, sampled_channels, samples_of_table
from excite.logs.table import table_of
from excite.logs.text import text_of
from regressors.errors import InputError
from regressors.samples import Array


def with_further_files(log: Log, path: Path, mapping: LogMapping, drop: frozenset[str], zero: float = 0.0) -> Log:
    """The log with the channels that a mapping says are in other files, interpolated linearly onto its rows."""
    for file in sorted({section.file for section in mapping.sections.values() if section.file is not None}):
        log = _with_file(log, path.parent / file.replace("{log}", path.stem), file, mapping, drop, zero)
    return log


def _with_file(log: Log, path: Path, file: str, mapping: LogMapping, drop: frozenset[str], zero: float) -> Log:
    other = _of_file(path, file, mapping, drop, zero)
    first, last = max(one.time[0] for one in other.columns), min(one.time[-1] for one in other.columns)
    inside = (log.time >= first) & (log.time <= last)
    if np.count_nonzero(inside) < 2:
        raise InputError(
            f"{path} is from {first:.6g} to {last:.6g} s, {log.source} from {log.time[0]:.6g} to "
            f"{log.time[-1]:.6g} s; one clock should have stamped both"
        )
    new = log.time[inside]
    columns: dict[str, list[Array]] = {}
    for one in other.columns:
        columns.setdefault(one.channel, []).append(np.interp(new, one.time, one.values))
    channels: dict[str, Any] = {name: np.column_stack(each) for name, each in columns.items()}
    outside = int(np.count_nonzero(~inside))
    rows = max(one.time.size for one in other.columns)
    note = f"{path.name}: {rows} rows, interpolated linearly onto the {np.count_nonzero(inside)} of the positions"
    note += f"; {outside} of these are before or after it and are not used" * bool(outside)
    both = sha256(f"{log.sha256} {recording_sha256(path)}".encode()).hexdigest()
    merged = replace(
        log.rows(np.flatnonzero(inside)),
        sha256=both,
        left_out=(*log.left_out, *other.notes, note),
        **channels,
    )
    bridged = np.any([in_gaps(merged.time, one.time) for one in other.columns], axis=0)
    return merged.without(DROPPED, bridged) if bridged.any() else merged


def _of_file(path: Path, file: str, mapping: LogMapping, drop: frozenset[str], zero: float) -> SampledChannels:
    if (form := binary_format(path)) is not None:
        return sampled_channels(form, path, mapping, file, zero)
    with text_of(path) as text:
        layout = mapping.layout(text.source, text.lines, file)
        of_table = samples_of_table(text.source, layout, table_of(text, layout, drop), zero)
        return replace(of_table, notes=(*text.mended, *of_table.notes))


def in_gaps(new: Array, time: Array) -> NDArray[np.bool_]:
    """Which instants lie in gaps of another clock, where it says nothing."""
    step = np.diff(time)
    before = np.clip(np.searchsorted(time, new, side="right") - 1, 0, step.size - 1)
    return np.asarray((step[before] > STEPS * np.median(step)) & (new > time[before]) & (new < time[before + 1]))
