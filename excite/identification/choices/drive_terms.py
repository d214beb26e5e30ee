"""Optional parameters of the drives among the columns of a model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from excite.identification.choices.columns import Group
from excite.information.target import IdentificationTarget
from excite.tasks.task import Task
from regressors.models.columns import ASYMMETRY, LOAD_SHARE, OFFSET, ROOT, ROTOR, STRIBECK

OPTIONS: Mapping[str, str] = {
    OFFSET: "offset",
    LOAD_SHARE: "load_share",
    ROOT: "root_friction",
    ASYMMETRY: "asymmetric_friction",
    STRIBECK: "stribeck",
}
WORDS: Mapping[str, str] = {
    OFFSET: "a constant offset",
    LOAD_SHARE: "a share of the carried torque",
    ROOT: "a part with the square root of the speed",
    ASYMMETRY: "viscous friction that differs by direction",
    STRIBECK: "a Stribeck part",
    ROTOR: "rotor inertias",
}
NAMES: Mapping[str, str] = {
    OFFSET: "offset",
    LOAD_SHARE: "load share",
    ROOT: "root of the speed",
    ASYMMETRY: "asymmetry",
    STRIBECK: "Stribeck part",
    ROTOR: "rotor inertia",
}
EVERY_DRIVE = 0  # number that stands for all drives together


@dataclass(frozen=True, eq=False)
class DriveTerms:
    """Columns of a target by whether they are optional."""

    always: tuple[int, ...]  # base columns that are kept
    optional: Mapping[Group, tuple[int, ...]]  # base columns by kind and drive; rotor inertias of all drives together


def drive_terms(target: IdentificationTarget, free: frozenset[str]) -> DriveTerms:
    """Sort a target's base columns."""
    optional: dict[Group, tuple[int, ...]] = {}
    always = []
    for k, index in enumerate(target.base.index):
        column = target.model.columns[index]
        owner = column.owner
        if column.kind == ROTOR and ROTOR in free:
            group = ROTOR, EVERY_DRIVE
        elif column.kind in OPTIONS and column.kind in free and owner is not None:
            group = column.kind, owner
        else:
            always.append(k)
            continue
        optional[group] = (*optional.get(group, ()), k)
    return DriveTerms(tuple(always), optional)


def with_terms(task: Task, groups: list[Group], free: frozenset[str]) -> Task:
    """A task with the chosen terms, and without the others that were free."""
    changes: dict[str, object] = {}
    for kind in free:
        drives = tuple(str(drive) for k, drive in sorted(groups) if k == kind)
        if kind == ROTOR:
            changes["joint_rotors"] = bool(drives)
        else:
            changes[OPTIONS[kind]] = drives or False
    return task.changed(**changes)


def added_columns(target: IdentificationTarget, names: Sequence[str]) -> list[int]:
    """Places of the base parameters that chosen terms are."""
    columns = [target.model.columns[index] for index in target.base.index]
    called = [c.kind if c.kind == ROTOR else f"{c.kind} {c.owner}" for c in columns]
    return [k for k, name in enumerate(called) if name in names]
