"""Logs read from files and written, in the house format or through a mapping."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from excite.logs.base_motion import with_base_motion
from excite.logs.event import Saturation
from excite.logs.guess.log_guess import certain_mapping
from excite.logs.layout import ForeignHeader, Layout, cells, columns_by_name, header_line, house_layout, listed
from excite.logs.log import Log, channels_of, counted
from excite.logs.mapping import GearedSection, LogMapping, read_mapping
from excite.logs.recorded_log import (
    recorded_log,
    sampled_channels,
    samples_of_table,
    whole_seconds,
    with_further_files,
    zero_note,
)
from excite.logs.recordings.formats import binary_format, recording_sha256
from excite.logs.recordings.recording import RecordingFormat
from excite.logs.table import Table, TextTable, table_of
from excite.logs.text import Text, text_of
from excite.registry import DROPPABLE
from excite.storage.atomic import check_table, read_json, replacing
from excite.storage.codec import record_of
from excite.storage.manifest import sha256_of
from excite.storage.migrations import is_of_kind, schema_of
from excite.storage.result_folder import settle_files
from excite.storage.sampled_motion import header_names, header_text
from regressors.arguments import checked
from regressors.errors import InputError, check_names
from regressors.robot.gears import ConstantRatio
from regressors.robot.robot import Drive, Robot
from regressors.samples import Array

LOOKED_AT = 200  # rows
SPARSE = 0.2


@checked
def read_log(
    path: str | Path,
    joints: Sequence[str] | None = None,
    mapping: LogMapping | str | Path | None = None,
    drop: Iterable[str] = (),
    only: tuple[int, int] | None = None,
    robot: Robot | None = None,
) -> Log:
    """Read a log from a file.

    The house format is CSV in UTF-8 with a header: ``time`` [s], then by name ``NAME.position`` [rad or m],
    ``NAME.velocity``, ``NAME.effort`` [Nm or N], ``NAME.temperature`` [deg C] or one ``temperature`` of all joints,
    ``NAME.command`` [rad or m], and ``wrench.force.x`` ... ``wrench.torque.z`` [N, Nm]; other columns are ignored, and
    named in `Log.left_out`. Other files and folders, of the formats in `excite.logs.recordings.formats`, are recognised
    by their content.

    Parameters
    ----------
    path : path
    joints : sequence of str, optional
        Joints to read, in this order; all that the file has if not given.
    mapping : LogMapping or path, optional
        How a foreign file is laid out; not needed for one that says itself what its columns are, in which units, see
        `excite.logs.guess.log_guess.guess_mapping`, which also proposes a mapping for the others.
    drop : iterable of str
        Faulty rows to leave out, not to refuse, counted in `Log.left_out`: ``truncated`` (a last line that was
        not written to its end), ``nan`` (cells that are empty, NaN or infinite), ``repeated`` (time of the row before),
        ``garbage`` (lines that hold no row of numbers; up to one in a hundred are left out anyway).
    only : (int, int), optional
        First and last row to read, 1 for the first; the others may be faulty.
    robot : Robot, optional
        Whose joints these are, for mappings that do not name them or that describe the motors' side.

    Raises
    ------
    InputError
        Not a log, with the line and the column of the first fault.
    UnknownName
        A joint that the file does not have, or a kind of fault that does not exist.
    """
    allowed = droppable_rows(joints, drop)
    settle_files(path := Path(path))
    form, notes = binary_format(path), tuple[str, ...]()
    if form is not None:
        form.check(path, allowed)
    mapping = read_mapping(mapping) if isinstance(mapping, str | Path) else mapping
    if mapping is None:
        house: ForeignHeader | None = None
        if form is None:
            try:
                return _in_house(path, joints, allowed, only, () if robot is None else robot.passive)
            except ForeignHeader as error:
                house = error
        mapping, form, notes = _recognised(path, robot, house)
    mapping = mapping.of(robot)
    if form is None:
        log, zero = _of_text(path, mapping, allowed, only)
    else:
        samples = sampled_channels(form, path, mapping)
        own, zero = recording_sha256(path), samples[2]
        log = recorded_log(str(path), own, samples, tuple(mapping.joints or ()), allowed, only)
    log = at_the_joints(with_further_files(log, path, mapping, allowed, zero), mapping, robot)
    log = replace(log, left_out=(*log.left_out, *notes))
    return log if joints is None else log.of(joints)


def droppable_rows(joints: Sequence[str] | None, drop: Iterable[str]) -> frozenset[str]:
    """Kinds of rows to leave out, where these and the joints can be."""
    check_names("kind of row to drop", sorted(allowed := frozenset(drop)), DROPPABLE)
    if joints is not None and not joints:
        raise InputError("joints: expected one or more names, given none; leave it out for all joints of the log")
    return allowed


def _recognised(
    path: Path, robot: Robot | None, error: ForeignHeader | None
) -> tuple[LogMapping, RecordingFormat | None, tuple[str, ...]]:
    """Mapping of a recording that says itself what its columns are; a text that does not is no log in house format."""
    if error is not None and not path.is_file():  # what comes through a pipe can be read once
        raise error
    guess, loaded = certain_mapping(path, robot, error)
    mapping = guess.mapping
    assert mapping is not None
    if robot is None and mapping.joints is None:
        numbers = [f"{k}" for k in range(1, len(mapping.position.columns) + 1)]
        mapping = mapping.model_copy(update={"joints": numbers})
    note = f"read as {guess.contents.format}, without a mapping: {' '.join(guess.recognised)}"
    return mapping, loaded if error is None else None, (note,)


def _in_house(
    path: Path, joints: Sequence[str] | None, drop: frozenset[str], only: tuple[int, int] | None, passive: Sequence[str]
) -> Log:
    with text_of(path) as text:
        head = header_line(text.lines)
        layout = house_layout(text.source, header_names(text.lines[head]), joints, head, passive)
        return log_of_table(table_of(text, layout, drop, only), text.mended)


def _of_text(path: Path, mapping: LogMapping, drop: frozenset[str], only: tuple[int, int] | None) -> tuple[Log, float]:
    """Log of a text, whose columns may be empty where another one was sampled, and the zero of its time [s]."""
    with text_of(path) as text:
        layout = mapping.layout(text.source, text.lines)
        if not _is_sparse(text, layout):
            return from_zero(log_of_table(table_of(text, layout, drop, only), text.mended))
        return log_of_sparse(TextTable(text, layout, drop, None), only)


def log_of_sparse(table: Table, only: tuple[int, int] | None) -> tuple[Log, float]:
    """Log of a table whose columns were sampled at instants of their own, and the zero of its time [s]."""
    samples = samples_of_table(table.source, table.layout, table)
    return recorded_log(table.source, table.sha256, samples, table.layout.joints, table.drop, only), samples[2]


def from_zero(log: Log) -> tuple[Log, float]:
    """Log whose times do not count so many seconds that a float loses digits, and what was subtracted [s]."""
    zero = whole_seconds(float(log.time[0]))
    if not zero:
        return log, zero
    return replace(log, time=log.time - zero, left_out=(*log.left_out, zero_note(zero))), zero


def _is_sparse(text: Text, layout: Layout) -> bool:
    """Whether a fifth of the first rows or more lack a cell."""
    rows = [cells(line, layout.separator) for line in text.lines[layout.first : layout.first + LOOKED_AT]]
    whole = [row for row in rows if len(row) == len(layout.names)]
    return sum(any(not row[k] for k in layout.used) for row in whole) > SPARSE * len(whole)


def log_of_table(table: Table, mended: tuple[str, ...] = ()) -> Log:
    """Log of a table, in SI, which says what was mended before it was read."""
    layout = table.layout
    place = {column: k for k, column in enumerate(layout.used)}
    parts: dict[str, Any] = {}
    for name, channel in layout.channels.items():
        parts[name] = values = table.values[:, [place[column] for column in channel.columns]]
        values -= channel.zero
        values *= channel.scale
    names = layout.unused
    unused = (f"{counted(len(names), 'column')} not used: {listed(names)}",) * bool(names)
    before = (f"{counted(layout.preface, 'line')} before the header not read",) * bool(layout.preface)
    time, numbers = table.clock * layout.second, table.lines - layout.first
    left_out, removed = (*mended, *before, *unused, *table.left_out), tuple(table.removed)
    return Log(
        table.source, table.sha256, layout.joints, time, **parts, left_out=left_out, numbers=numbers, removed=removed
    )


def at_the_joints(log: Log, mapping: LogMapping, robot: Robot | None) -> Log:
    """The log with the channels that a mapping describes on the motors' side, or of a base, converted to the joints.

    With the motor angle phi of each drive, its gear ``phi = F(z)`` and the coupling ``z = C q + z0``::

        q = C^-1 (F^-1(phi) - z0),   dq = C^-1 (dphi / F'(z)),   tau_q = C' (F'(z) tau_motor)

    Motor angles are zero where the drive coordinates are; another zero is the `offset` of the mapping.
    """
    sections = mapping.sections
    motor = {name: s for name, s in sections.items() if isinstance(s, GearedSection) and s.side == "motor"}
    if not motor:
        return with_base_motion(log, mapping, robot)
    if robot is None:
        raise InputError("the log mapping has side: motor, but no robot is given whose gears these are")
    index = [robot.joint_index(name) for name in log.joints]
    C, zero = _coupling(robot, index)
    transmission, drives = robot.transmission, [Drive(name) for name in log.joints]  # of ratio one where there is none
    if transmission is not None:
        drives = [transmission.drives[k - len(robot.base_joints)] for k in index]
    without = [drive.name for drive in drives if drive.ratio == ConstantRatio(1.0)]
    if without and any(section.own_gears for section in motor.values()):
        raise InputError(
            f"{robot.name} states no gear ratio of {', '.join(without)}; give ratio with side: motor in the log mapping"
        )

    def turned(z: Array, name: str) -> Array:
        if name not in motor:
            return z
        if motor[name].own_gears:
            z = np.column_stack([drive.ratio.coordinate(phi) for drive, phi in zip(drives, z.T, strict=True)])
        return _at_joints(C, z - zero)

    q, dq, effort = turned(log.q, "q"), log.dq, log.effort
    command = None if log.command is None else turned(log.command, "command")
    ratios = _ratios(q @ C.T + zero, drives)
    if "dq" in motor and dq is not None:
        dq = _at_joints(C, dq / ratios if motor["dq"].own_gears else dq)
    if "effort" in motor and effort is not None:
        effort = (effort * ratios if motor["effort"].own_gears else effort) @ C
    return with_base_motion(replace(log, q=q, dq=dq, effort=effort, command=command), mapping, robot)


def _at_joints(C: Array, z: Array) -> Array:
    return np.asarray(np.linalg.solve(C, z.T).T, dtype=float)


def _coupling(robot: Robot, index: list[int]) -> tuple[Array, Array]:
    """``C`` and ``z0`` of the drives of some joints."""
    if robot.transmission is None:
        return np.eye(len(index)), np.zeros(len(index))
    C, names = robot.transmission.coupling, robot.joint_names
    if C.shape[0] != robot.n:
        raise InputError(f"{robot.name} has {C.shape[0]} drives for {robot.n} joints; give the log at the joints")
    others = [k for k in range(robot.n) if k not in index]
    own = [k - len(robot.base_joints) for k in index]  # places of their drives
    for k in own:
        if coupled := [names[j] for j in others if C[k, j] != 0]:
            raise InputError(
                f"drive {robot.transmission.drives[k].name} of {robot.name} also moves with {', '.join(coupled)}; name "
                "it among the joints of the log mapping"
            )
    return C[np.ix_(own, index)], robot.transmission.offset[own]


def _ratios(z: Array, drives: list[Drive]) -> Array:
    """``F'(z)`` of each drive, shape (N, n)."""
    symbol = ca.SX.sym("z")
    ratios = [ca.Function("ratio", [symbol], [drive.ratio.ratio(symbol)]) for drive in drives]
    return np.column_stack([np.asarray(f(column[None, :])).ravel() for f, column in zip(ratios, z.T, strict=True)])


def write_log(log: Log, path: str | Path) -> None:
    """Write a log as CSV that reads back to the same bits."""
    columns = columns_by_name(log.source, log.time, channels_of(log), log.joints)
    header, table = list(columns), np.column_stack(list(columns.values()))
    check_table(Path(path), header, table)
    with replacing(Path(path)) as stream:
        np.savetxt(stream, table, fmt="%.17g", delimiter=",", header=header_text(header), comments="")


KIND, LOG = "log", "log"
SCHEMA = schema_of(KIND)


def sidecar_path(log: str | Path) -> Path:
    """Path of the sidecar file of a log."""
    path = Path(log)
    if path.suffix == ".json":
        raise InputError(f"{path}: a log ending in .json leaves no name for the file beside it")
    return path.with_suffix(".json")


def log_entry(log: Path) -> dict[str, Any]:
    """Entry ``log`` of a sidecar file, by which an edited log is found; empty where there is no log."""
    sha256 = sha256_of(log)
    return {} if sha256 is None else {LOG: {"sha256": sha256}}


def read_sidecar(log: str | Path) -> dict[str, Any] | None:
    """Content of the sidecar file of a log; None where there is none."""
    if Path(log).suffix == ".json" or not (path := sidecar_path(log)).exists():
        return None
    settle_files(Path(log))
    content = read_json(path)
    if not is_of_kind(KIND, content.get("schema")):
        raise InputError(f"{path}: expected schema {SCHEMA}, given {content.get('schema')!r}")
    robot, truth = content.get("robot"), content.get("truth")
    if not isinstance(robot, dict) or not all(isinstance(robot.get(key), str) for key in ("name", "sha256")):
        raise InputError(f"{path}: robot should have a name and a sha256")
    numbers = isinstance(truth, dict) and all(type(value) in (int, float) for value in truth.values())
    if truth is not None and not numbers:
        raise InputError(f"{path}: truth should map names of standard parameters to numbers")
    if LOG in content and not (isinstance(of := content[LOG], dict) and isinstance(of.get("sha256"), str)):
        raise InputError(f"{path}: log should have a sha256")
    saturated_torques(content, path)
    return content


def saturated_torques(content: Mapping[str, Any], source: str | Path) -> tuple[Saturation, ...]:
    """Torques that a file beside a log says were at their limit; none where it says nothing of it."""
    given = content.get("saturated", [])
    try:
        if isinstance(given, list) and all(isinstance(one, dict) for one in given):
            return tuple(record_of(Saturation, one, {}) for one in given)
    except InputError:
        pass
    raise InputError(
        f"{source}: saturated should list objects of torque, limit, unit, rows, and spans of two times each"
    )


def with_sidecar(log: Log, robot: Robot) -> Log:
    """A log with what its sidecar file says: true parameters, and torques at their limit.

    A sidecar file of a log that was edited since is ignored, which `Log.left_out` says: what it says of rows and times
    need not hold any longer. One without the hash of its log is used as it is.
    """
    content = read_sidecar(log.source)
    if content is None:
        return log
    if LOG in content and content[LOG]["sha256"] != sha256_of(Path(log.source)):
        beside = sidecar_path(log.source).name
        note = f"{beside} beside it is ignored, since the log was changed after that file was written"
        return replace(log, left_out=(*log.left_out, note))
    if content["robot"]["sha256"] != robot.sha256():
        name, sha256 = (content["robot"][key] for key in ("name", "sha256"))
        raise InputError(
            f"{log.source} is a log of {name} (description {sha256[:12]}), not of {robot.name} ({robot.sha256()[:12]})"
        )
    return replace(log, truth=content.get("truth"), saturated=saturated_torques(content, log.source))
