"""Reader of robot YAML files.

The fields are those of `regressors.readers.description_schema`. All problems of single fields are reported together;
what involves several fields (names that must exist, counts that must agree) is checked once each field is valid.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import compress
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from regressors.errors import Finding, InputError, UnknownName, about, reading
from regressors.input_files import read_text
from regressors.readers.description_schema import AggregatesSection, Description, LinkSection, coefficient_value, limits
from regressors.readers.documents import Document, FieldPath, parse_document, validate
from regressors.readers.urdf_tree import TreeJoint
from regressors.robot.columns import FRICTION_KINDS, ROTOR, Column, body_columns, drive_column
from regressors.robot.inertia import parameter_names
from regressors.robot.robot import BASE, Aggregates, Branch, Limits, Link, Robot, Structure, Transmission

Problems = Iterator[tuple[FieldPath, str]]


def read_description(path: str | Path) -> Robot:
    """Robot described by a YAML file."""
    with reading(repr(str(path))):
        text = read_text(path)
    return parse_description(text, str(path))


def parse_description(text: str, source: str) -> Robot:
    """Robot described by a YAML text."""
    document = parse_document(text, source)
    if isinstance(document.content, dict) and "robot" in document.content and "joints" not in document.content:
        raise InputError(f"{source} names a robot and describes none; give that robot, and this file as `task`")
    description = validate(document, Description)
    links = description.links or [LinkSection(name=f"link{k}") for k in range(1, len(description.joints) + 1)]
    branches = tuple(branch.branch() for branch in description.branches)
    chain = tuple(link.link() for link in links)
    bodies = [(body.number or k, body) for k, body in enumerate((*chain, *(branch.link for branch in branches)), 1)]
    problems = [*_count_problems(description, links), *_parent_problems(description, links)]
    problems += _branch_problems(description, links)
    problems += [*_name_problems(description, bodies), *_value_problems(description, bodies)]
    if problems:
        raise document.error(problems)
    return _robot(document, description, chain, branches)


def _robot(
    document: Document, description: Description, links: tuple[Link, ...], branches: tuple[Branch, ...]
) -> Robot:
    structure = description.structure
    names = [joint.name for joint in description.joints]
    with about(document.source):
        return Robot(
            name=description.name,
            joints=tuple(joint.joint_named(joint.name) for joint in description.joints),
            parents=tuple(_parents(description, links)),
            links=links,
            limits=limits([joint.limits for joint in description.joints]),
            transmission=_transmission(description),
            gravity=np.array(description.gravity),
            structure=Structure(
                zero=frozenset(structure.zero),
                equal=tuple(tuple(group) for group in structure.equal),
                aggregates=tuple(_aggregates(a, names, description.constants) for a in structure.aggregates),
            ),
            constants=description.constants,
            source=description.source or document.source,
            branches=branches,
            home=None if description.home is None else np.array(description.home),
            shapes=tuple(shape.part() for shape in description.shapes),
            closures=tuple(loop.closure() for loop in description.loops),
            passive=tuple(description.passive),
        )


def _transmission(description: Description) -> Transmission | None:
    if description.drives is None:
        return None
    coupling = np.eye(len(description.joints)) if description.coupling is None else np.array(description.coupling)
    bounds: Limits = limits([drive.coordinate_limits for drive in description.drives])
    offset = np.array([drive.offset for drive in description.drives])
    return Transmission(coupling, tuple(drive.drive() for drive in description.drives), bounds, offset)


def _aggregates(section: AggregatesSection, joints: Sequence[str], constants: dict[str, float]) -> Aggregates:
    parameters = {
        name: {parameter: coefficient_value(coefficient, constants) for parameter, coefficient in terms.items()}
        for name, terms in section.parameters.items()
    }
    return Aggregates(tuple(sorted(section.joints, key=joints.index)), parameters)


def _count_problems(description: Description, links: Sequence[LinkSection]) -> Problems:
    n = len(description.joints)
    if len(links) != n:
        yield ("links",), f"expected as many links as joints, {n}, given {len(links)}"
    for field, items in (("joints", description.joints), ("links", links), ("drives", description.drives or [])):
        names = [item.name for item in items]
        for k, name in enumerate(names):
            if name in names[:k]:
                yield (field, k, "name"), f"the name {name!r} is given twice"
    if description.home is not None and len(description.home) != n:
        yield ("home",), f"expected as many numbers as joints, {n}, given {len(description.home)}"
    coupling, drives = description.coupling, description.drives
    if coupling is None:
        if drives is not None and len(drives) != n:
            yield ("drives",), f"{len(drives)} drives of {n} joints need a coupling"
        return
    if drives is None:
        yield ("coupling",), "a coupling needs drives"
    elif len(coupling) != len(drives):
        yield ("coupling",), f"expected as many rows as drives, {len(drives)}, given {len(coupling)}"
    for k, row in enumerate(coupling):
        if len(row) != n:
            yield ("coupling", k), f"expected as many columns as joints, {n}, given {len(row)}"


def _parents(description: Description, links: Sequence[LinkSection | Link]) -> Iterator[int]:
    """Number of the link that carries each joint, 0 for the base."""
    names = [BASE, *(link.name for link in links)]
    for k, joint in enumerate(description.joints):
        yield k if joint.parent is None else names.index(joint.parent)


def _parent_problems(description: Description, links: Sequence[LinkSection]) -> Problems:
    names = [BASE, *(link.name for link in links)]
    for k, joint in enumerate(description.joints):
        if joint.parent is not None and joint.parent not in names[: k + 1]:
            yield ("joints", k, "parent"), str(UnknownName("earlier link", joint.parent, names[: k + 1]))


def _branch_problems(description: Description, links: Sequence[LinkSection]) -> Problems:
    n = len(description.joints)
    carriers, numbers = [BASE, *(link.name for link in links)], [*range(1, n + 1)]
    if description.branches and BASE in carriers[1:]:
        yield ("links", carriers[1:].index(BASE), "name"), f"the name {BASE!r} is that of the base frame"
    for k, branch in enumerate(description.branches):
        number = branch.number or n + k + 1
        if branch.parent not in carriers:
            yield ("branches", k, "parent"), str(UnknownName("link or earlier branch", branch.parent, carriers))
        if branch.name in carriers:
            yield ("branches", k, "name"), f"the name {branch.name!r} is that of the base, a link or another branch"
        if len(branch.coupling) != n:
            yield ("branches", k, "coupling"), f"expected one number per joint, {n}, given {len(branch.coupling)}"
        if number in numbers:
            yield ("branches", k, "number"), f"the number {number} is already that of a link or branch"
        carriers.append(branch.name)
        numbers.append(number)


def _name_problems(description: Description, bodies: Sequence[tuple[int, Link]]) -> Problems:
    structure, joints = description.structure, [joint.name for joint in description.joints]
    rotors = [False] * len(joints)
    if description.drives is not None:
        rotors = [drive.rotor_inertia is not None for drive in description.drives]
    columns = [column for k, _ in bodies for column in body_columns(parameter_names(k), k)]
    for k, has_rotor in enumerate(rotors, 1):
        columns += [drive_column(k, kind) for kind in (*([ROTOR] * has_rotor), *FRICTION_KINDS)]
    parameters = {column.name for column in columns}
    named: list[tuple[FieldPath, str]] = [(("zero", k), name) for k, name in enumerate(structure.zero)]
    named += [(("equal", i, k), name) for i, group in enumerate(structure.equal) for k, name in enumerate(group)]
    for i, form in enumerate(structure.aggregates):
        here: FieldPath = ("aggregates", i)
        named += [((*here, "parameters", x, p), p) for x, terms in form.parameters.items() for p in terms]
        for k, joint in enumerate(form.joints):
            if joint not in joints:
                yield ("structure", *here, "joints", k), str(UnknownName("joint", joint, joints))
        if len(set(form.joints)) < len(form.joints):
            yield ("structure", *here, "joints"), "a joint is given twice"
        if any(set(form.joints) == set(other.joints) for other in structure.aggregates[:i]):
            yield ("structure", *here), "these joints have aggregates already"
    taken: set[str] = set()
    for path, name in named:
        if name not in parameters:
            yield ("structure", *path), str(UnknownName("parameter", name, _alike(name, columns)))
        elif path[0] != "aggregates" and name in taken:
            yield ("structure", *path), f"{name} is already declared zero or equal to another"
        taken.add(name)


def _alike(name: str, columns: Sequence[Column]) -> Sequence[str]:
    """Parameters of the bodies and drives whose number occurs in the name, or all if there are none."""
    return [c.name for c in columns if str(c.owner) in name] or [c.name for c in columns]


def _value_problems(description: Description, bodies: Sequence[tuple[int, Link]]) -> Problems:
    structure = description.structure
    for i, form in enumerate(structure.aggregates):
        for name, terms in form.parameters.items():
            for parameter, coefficient in terms.items():
                try:
                    coefficient_value(coefficient, description.constants)
                except InputError as error:
                    yield ("structure", "aggregates", i, "parameters", name, parameter), str(error)
    known = known_values(bodies)
    for k, name in enumerate(structure.zero):
        if known.get(name, 0.0) != 0.0:
            yield ("structure", "zero", k), f"{name} is declared zero, but its link gives {known[name]:g}"
    for k, group in enumerate(structure.equal):
        values = {name: known[name] for name in group if name in known}
        if not np.allclose(list(values.values()), next(iter(values.values()), 0.0), rtol=1e-9, atol=0.0):
            listed = ", ".join(f"{name} = {value:g}" for name, value in values.items())
            yield ("structure", "equal", k), f"are declared equal, but the links give {listed}"


def known_values(bodies: Iterable[tuple[int, Link]]) -> dict[str, float]:
    """Known parameters; zeros that a rotated frame turned into rounding errors are zero again."""
    values: dict[str, float] = {}
    for number, body in bodies:
        if body.theta is not None:
            noise = 1e-12 * float(np.max(np.abs(body.theta)))
            theta = np.where(np.abs(body.theta) > noise, body.theta, 0.0)
            values |= zip(parameter_names(number), theta.tolist(), strict=True)
    return values


_DEGREES = 25.0  # rad; no joint turns four times to one side, and few have a range below 25 degrees


def range_of(joint: TreeJoint) -> tuple[float, float]:
    """Lower and upper position limit, see `parse_urdf`; infinite where there is none, or none is known [rad or m]."""
    if joint.kind == "continuous" or _is_missing(joint):
        return -np.inf, np.inf
    return joint.bounds.get("lower", 0.0), joint.bounds.get("upper", 0.0)


def _is_missing(joint: TreeJoint) -> bool:
    return joint.kind != "continuous" and not (joint.bounds.get("lower") or joint.bounds.get("upper"))


def range_findings(chain: Iterable[TreeJoint]) -> Iterator[Finding]:
    """What is not stated of the ranges of joints, and what is implausible."""
    for joint in chain:
        where, (lower, upper) = f"joint {joint.name!r}", range_of(joint)
        if _is_missing(joint):
            zero = "lower" in joint.bounds and "upper" in joint.bounds
            what = "<limit> says lower=0 and upper=0, which leaves no room" if zero else "no position limits are stated"
            held = ', type="fixed" if it does not move' if zero else ""
            advice = (
                f'write <limit lower="..." upper="..." effort="..." velocity="..."/> into the file, or '
                f'type="continuous" if it turns without end{held}, or give `position`'
            )
            yield Finding("missing", where, what, advice, joint.name)
        elif joint.kind != "continuous" and len(joint.bounds.keys() & {"lower", "upper"}) == 1:
            (other,) = {"lower", "upper"} - joint.bounds.keys()
            yield Finding("assumed", where, f"{other}=0, which <limit> does not state", f"write {other} into the file")
        elif joint.kind == "revolute" and any(_DEGREES < abs(bound) < np.inf for bound in (lower, upper)):
            what = f"turns from {lower:g} to {upper:g} rad"
            yield Finding("suspicious", where, what, "limits are in radians, not in degrees")


def refuse_missing_ranges(robot: Robot, moving: ArrayLike) -> None:
    """Raise `InputError` where joints shall move whose ranges are not known, though they have ends."""  # moving (n,)
    unlimited = np.isinf(robot.limits.lower) & np.isinf(robot.limits.upper) & np.asarray(moving, dtype=bool)
    names = set(compress(robot.joint_names, unlimited))
    missing = [note for note in robot.notes if note.joint and note.joint in names]
    if missing:
        others = f" (the same for {', '.join(note.joint for note in missing[1:])})" if len(missing) > 1 else ""
        raise InputError(f"{robot.source}, {missing[0].where}: {missing[0].what}{others}; {missing[0].advice}")
