"""Logs given as objects, files or simulations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Protocol

from excite.logs.log import Log
from excite.logs.log_reading import read_log
from excite.logs.mapping import LogMapping, read_mapping
from excite.logs.sidecar import with_sidecar
from excite.storage.result_file import read_settled_files
from regressors.errors import InputError
from regressors.robot.robot import Robot


class Measured(Protocol):
    """What has a log, such as a simulation."""

    @property
    def measured(self) -> Log:
        """The log."""


LogLike = Log | str | Path | Measured


def read_logs(
    given: LogLike | Sequence[LogLike],
    robot: Robot,
    mapping: LogMapping | str | Path | None,
    drop: tuple[str, ...],
    progress: Callable[[str], None],
    only: tuple[int, int] | None = None,
) -> list[Log]:
    """Read logs and refuse duplicates; simulated ones keep their true parameters."""
    layout = read_mapping(Path(mapping)) if isinstance(mapping, str | Path) else mapping
    logs: dict[str, Log] = {}
    for item in given if isinstance(given, list | tuple) else (given,):
        if isinstance(item, str | Path):
            progress(f"reading {item}")
        log = log_of(item, robot, layout, drop, only)
        if log.sha256 in logs:
            raise InputError(f"{log.source} has the same content as {logs[log.sha256].source}; give each log once")
        logs[log.sha256] = log
    return list(logs.values())


def log_of(
    given: LogLike,
    robot: Robot | None,
    mapping: LogMapping | None = None,
    drop: tuple[str, ...] = (),
    only: tuple[int, int] | None = None,
) -> Log:
    """Log with its hash, from a log, its file, or a simulation."""
    if isinstance(given, str | Path):
        path = Path(given)
        return read_settled_files(path, lambda: _read(path, robot, mapping, drop, only))
    measured = getattr(given, "measured", given)
    if not isinstance(measured, Log):
        raise InputError(f"expected a log, the name of its file, or a simulation; given {type(given).__name__}")
    return replace(measured, sha256=measured.identity)


def _read(
    path: Path,
    robot: Robot | None,
    mapping: LogMapping | None,
    drop: tuple[str, ...],
    only: tuple[int, int] | None,
) -> Log:
    log = read_log(path, None, mapping, drop, only, robot)
    return log if robot is None else with_sidecar(log, robot)
