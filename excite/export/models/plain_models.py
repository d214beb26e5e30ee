"""Identified models as plain data: robot YAML, actuators of Isaac Lab, BAM, arrays, tables as CSV, LaTeX, Markdown.

Isaac Lab 2.3 documentation, ``isaaclab.actuators.ImplicitActuatorCfg``: ``joint_names_expr``, ``effort_limit_sim``,
``velocity_limit_sim``, ``armature``, ``friction`` (static), ``dynamic_friction`` and ``viscous_friction``, each by
joint name; from Isaac Sim 5.0 on the frictions are efforts [Nm or N], the viscous one [Nm s/rad or N s/m]. An explicit
`DelayedPDActuatorCfg` has ``effort_limit`` beside, and ``min_delay`` and ``max_delay`` in steps of the physics.

Pinocchio's `Inertia` has mass, lever (the centre of mass) and rotational inertia about it; `toDynamicParameters` is
(m, mcx, mcy, mcz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz) about the joint's frame. `Model.rotorInertia`, `rotorGearRatio`,
`damping`, `friction` and `armature` have one entry per joint.
"""

from __future__ import annotations

import csv
import io
import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from excite.export.models.export_model import ModelFormat, ModelText
from excite.export.models.exported_model import about_centre
from excite.export.models.identified_model import (
    BRANCHES,
    COUPLED,
    LISTED,
    LOOPS,
    TABLE,
    TEMPERATURE,
    VARYING,
    IdentifiedModel,
)
from excite.export.models.robot_yaml import robot_text
from excite.export.models.servo_model import FRICTION, ServoRobot
from regressors.errors import InputError, listed_names
from regressors.models.reduction import inertial_columns
from regressors.models.servo_response import STRIBECK_SPEED
from regressors.readers.documents import yaml_float
from regressors.robot.columns import COULOMB, ROTOR, VISCOUS, drive_column
from regressors.robot.inertia import PARAMETERS_PER_LINK
from regressors.robot.robot import linear_drives


class YamlFormat(ModelFormat):
    """Robot YAML: bodies, drives with their coupling and gears, Coulomb and viscous friction, limits."""

    name = "robot YAML"
    suffix = ".yaml"
    expresses = frozenset({ROTOR, COULOMB, VISCOUS, COUPLED, VARYING, BRANCHES, LOOPS})

    def text(self, model: IdentifiedModel, comment: tuple[str, ...], robot_file: Path | None = None) -> ModelText:
        """See `excite.export.models.export_model.ModelFormat.text`."""
        robot = model.robot.replace(source=f"{model.described.source}, with identified parameters")
        return ModelText("".join(f"# {line}\n" for line in comment) + robot_text(robot))

    def servo_text(self, servos: ServoRobot, robot_file: Path | None = None) -> ModelText:
        """See `excite.export.models.export_model.ModelFormat.servo_text`: not a robot, but every quantity by name."""
        lines = [f"# {line}" for line in (servos.comment[0], _EQUATIONS, *servos.notes)]
        lines += [f"robot: {json.dumps(servos.robot.name)}", f"stribeck_speed: {STRIBECK_SPEED}", "servos:"]
        rows = zip(servos.result.stated.items(), servos.result.known.tolist(), strict=True)
        for (joint, quantities), known in rows:
            lines.append(f"  {json.dumps(joint)}:")
            for (name, each), shown in zip(quantities.items(), known, strict=True):
                ends = [_interval(each), f"known: {str(shown).lower()}"]
                if ratio := each.get("over_stiffness"):
                    ends.append(f"over_stiffness: {{{_interval(ratio)}}}")
                lines.append(f"    {name}: {{symbol: {each['symbol']}, {', '.join(ends)}}}")
        return ModelText("\n".join([*lines, ""]))


_EQUATIONS = "the equations of these quantities are those of regressors.models.servo_response"


def _interval(stated: dict[str, Any]) -> str:
    value, half = (yaml_float(n) if math.isfinite(n) else ".inf" for n in (stated["value"], stated["half_width"]))
    return f"value: {value}, half_width: {half}, unit: {stated['unit']}"


_NOTES = (
    "not played: the fields are those of Isaac Lab 2.3 with Isaac Sim 5.0 or later; Isaac Lab 3.0 calls the limits "
    "joint_effort_limit and joint_velocity_limit",
    "stiffness and damping are gains of the controller, which an identification does not know: fill them in",
    "the inertia of the links is not part of an actuator configuration: import the URDF or the MJCF of this result",
)


class IsaacFormat(ModelFormat):
    """Fields of Isaac Lab's `ImplicitActuatorCfg` as YAML: armature, friction and limits of joints."""

    name = "Isaac Lab"
    suffix = ".yaml"
    expresses = frozenset({ROTOR, COULOMB, VISCOUS})

    def text(self, model: IdentifiedModel, comment: tuple[str, ...], robot_file: Path | None = None) -> ModelText:
        """See `excite.export.models.export_model.ModelFormat.text`."""
        robot = model.robot
        friction = [model.friction(k) for k in range(robot.n)]
        columns: dict[str, list[float | None]] = {
            "effort_limit_sim": robot.limits.torque.tolist(),
            "velocity_limit_sim": robot.limits.velocity.tolist(),
            "armature": [model.armature(k) for k in range(robot.n)],
            "friction": friction,
            "dynamic_friction": friction,
            "viscous_friction": [model.damping(k) for k in range(robot.n)],
        }
        lines = [*(f"# {line}" for line in (*comment, *_NOTES)), "actuators:"]
        free = ("    stiffness: null", "    damping: null")
        lines += _actuators("identified", "ImplicitActuatorCfg", robot.joint_names, columns, *free)
        return ModelText("\n".join([*lines, ""]), _NOTES)

    def servo_text(self, servos: ServoRobot, robot_file: Path | None = None) -> ModelText:
        """See `excite.export.models.export_model.ModelFormat.servo_text`."""
        result, limits, names = servos.result, servos.robot.limits, servos.robot.joint_names
        columns: dict[str, list[float | None]] = {
            "stiffness": result.of("K").tolist(),
            "damping": [0.0] * servos.robot.n,
            "effort_limit_sim": limits.torque.tolist(),
            "velocity_limit_sim": limits.velocity.tolist(),
            "armature": result.of("J").tolist(),
            "friction": (servos.resisting + result.of("Fs")).tolist(),
            "dynamic_friction": servos.resisting.tolist(),
            "viscous_friction": result.of("D").tolist(),
        }
        notes = (_NOTES[0], *_SERVO_NOTES, _NOTES[2])
        lines = [f"# {line}" for line in (*servos.comment, *servos.notes, *notes)]
        lines += ["actuators:", *_actuators("servos", "ImplicitActuatorCfg", names, columns), "delayed_actuators:"]
        steps = np.round(result.of("d") / _STEP).astype(int)
        explicit = {"effort_limit": columns["effort_limit_sim"], **columns}
        for count in np.unique(steps).tolist():
            late = [k for k in range(servos.robot.n) if steps[k] == count]
            own = {field: [values[k] for k in late] for field, values in explicit.items()}
            delay = (f"    min_delay: {count}", f"    max_delay: {count}")
            group = f"servos_{count}", "DelayedPDActuatorCfg", [names[k] for k in late]
            lines += _actuators(*group, own, *delay)
        return ModelText("\n".join([*lines, ""]), notes)


_STEP = 0.005  # of the physics, by which delays are counted [s]
_SERVO_NOTES = (
    "take the group actuators, which has no delay, or in its place delayed_actuators, whose delays are counted in "
    f"steps of {_STEP:g} s of the physics; these are explicit",
    f"{FRICTION}; what holds a joint has Fs (Stribeck friction) beside",
    "the offset b is not in an actuator configuration: subtract it from the commands",
)


def _actuators(
    group: str, kind: str, joints: Sequence[str], columns: Mapping[str, Sequence[float | None]], *further: str
) -> list[str]:
    """Lines of a configuration of actuators of some joints."""
    names = [json.dumps(re.escape(name), ensure_ascii=False) for name in joints]
    lines = [f"  {group}:", f"    class_type: {kind}", f"    joint_names_expr: [{', '.join(names)}]", *further]
    for field, values in columns.items():
        rows = zip(names, values, strict=True)
        known = [f"      {name}: {yaml_float(x + 0.0)}" for name, x in rows if x is not None and math.isfinite(x)]
        lines += [f"    {field}:", *known] if known else []
    return lines


_BAM = {"Fc": "friction_base", "Fs": "friction_stribeck", "mu": "load_friction_external", "J": "armature"}
_BAM |= {"d": "command_delay", "K": "K", "D": "D"}
_BAM_NOTES = (
    "friction is that of BAM's model m5 by the external torque alone",
    "no motion shows kt and R of BAM, nor what of D is friction: write the name of your servo in BAM as actuator, and "
    "values with vin kp error_gain error_gain_ratio kt / R = K, vin max_pwm kt / R = L and "
    "kt^2 / R + friction_viscous = D; all such values move alike, and BAM fails where there are none",
    "BAM has no dead band, and its q_offset turns the arm against gravity, which the offset b of a command does not: "
    "subtract b from the commands",
)


class BamFormat(ModelFormat):
    """Parameters of BAM's friction model m5, by servo.

    Rhoban, Better Actuator Models, ``bam/model.py`` (`Model.compute_frictions`, `load_model_from_dict`): names that the
    model does not have are ignored, those that are not given keep the values of the actuator.
    """

    name = "BAM"
    expresses = frozenset()

    def text(self, model: IdentifiedModel, comment: tuple[str, ...], robot_file: Path | None = None) -> ModelText:
        """Refuse what is not of servos."""
        raise InputError("BAM holds servos, and this result is of torques: identify with the model servo")

    def servo_text(self, servos: ServoRobot, robot_file: Path | None = None) -> ModelText:
        """See `excite.export.models.export_model.ModelFormat.servo_text`."""
        if linear := [joint.name for joint in servos.robot.joints if joint.kind == "prismatic"]:
            raise InputError(f"BAM's servos turn, and {listed_names(linear)} slides; choose mjcf, urdf, isaac or yaml")
        filled = {"model": "m5", "actuator": None, "kt": None, "R": None, "friction_viscous": None, "q_offset": 0.0}
        filled |= {"dtheta_stribeck": STRIBECK_SPEED, "alpha": 2.0, "load_friction_motor": 0.0}
        filled |= {"load_friction_motor_stribeck": 0.0, "load_friction_external_stribeck": 0.0}
        columns = {name: servos.result.of(symbol) for symbol, name in _BAM.items()}
        columns |= {"L": servos.result.torque_limit, "max_velocity": servos.result.speed_limit}
        each = {
            joint: filled | {name: float(x[k]) for name, x in columns.items() if np.isfinite(x[k])}
            for k, joint in enumerate(servos.robot.joint_names)
        }
        content = {"source": servos.comment, "notes": (*servos.notes, *_BAM_NOTES), "servos": each}
        return ModelText(json.dumps(content, indent=1, ensure_ascii=False) + "\n", _BAM_NOTES)


_PINOCCHIO = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]  # its order of the ten parameters


class NpzFormat(ModelFormat):
    """NumPy arrays, read by ``numpy.load(file, allow_pickle=False)``."""

    name = "NPZ"
    suffix = ".npz"
    expresses = frozenset({ROTOR, COULOMB, VISCOUS, COUPLED})

    def text(self, model: IdentifiedModel, comment: tuple[str, ...], robot_file: Path | None = None) -> ModelText:
        """See `excite.export.models.export_model.ModelFormat.text`."""
        np.savez(stream := io.BytesIO(), allow_pickle=False, **arrays(model, comment))
        return ModelText(stream.getvalue())


def arrays(model: IdentifiedModel, comment: tuple[str, ...]) -> dict[str, Any]:
    """Arrays of the file by their names."""
    robot, n = model.robot, range(model.robot.n)
    thetas = [np.full(PARAMETERS_PER_LINK, np.nan) if link.theta is None else link.theta for link in robot.links]
    bodies = [about_centre(theta) for theta in thetas]
    one = [drives[0] if len(drives := model.joint_drives(k)) == 1 else None for k in n]
    return {
        "comment": np.array(comment),
        "robot": np.array(model.described.name),
        "joint_names": np.array(robot.joint_names),
        "parents": np.array(robot.parents),
        "link_names": np.array([link.name for link in robot.links]),
        "mass": np.array([mass for mass, _, _ in bodies]),
        "lever": np.array([centre for _, centre, _ in bodies]),
        "inertia": np.array([inertia for _, _, inertia in bodies]),
        "dynamic_parameters": np.array([theta[_PINOCCHIO] for theta in thetas]),
        "placement_rotation": np.array([joint.rotation for joint in robot.joints]),
        "placement_translation": np.array([joint.translation for joint in robot.joints]),
        "axis": np.array([joint.axis for joint in robot.joints]),
        "prismatic": np.array([joint.kind == "prismatic" for joint in robot.joints]),
        "gravity": np.array(robot.gravity),
        "rotorInertia": np.array([d.rotor_inertia or 0.0 if d is not None and d.ratio else 0.0 for d in one]),
        "rotorGearRatio": np.array([d.ratio * d.factor if d is not None and d.ratio else 0.0 for d in one]),
        "armature": np.array([model.armature(k) or 0.0 for k in n]),
        "damping": np.array([model.damping(k) or 0.0 for k in n]),
        "friction": np.array([model.friction(k) or 0.0 for k in n]),
        "drive_names": np.array([drive.name for drive in model.drives]),
        "coupling": np.array([drive.row for drive in model.drives]),
        "drive_armature": np.array([drive.reflected or 0.0 for drive in model.drives]),
        "drive_damping": np.array([drive.viscous or 0.0 for drive in model.drives]),
        "drive_friction": np.array([drive.coulomb or 0.0 for drive in model.drives]),
        "lower": robot.limits.lower,
        "upper": robot.limits.upper,
        "velocity_limit": robot.limits.velocity,
        "effort_limit": robot.limits.torque,
        "base_parameter_names": np.array([parameter.name for parameter in model.parameters]),
        "base_parameters": np.array([parameter.value for parameter in model.parameters]),
    }


HEAD = ("part", "owner", "name", "expression", "value", "standard deviation", "99 % low", "99 % high", "unit")
Row = tuple[str | float | None, ...]  # one parameter, in the order of the head; None where there is no number
_UNKNOWN = (None, None, None)  # deviation and interval
SIX_DIGITS = "numbers are rounded to six digits; the CSV table holds every digit"
# tables for readers: title, part, and columns
_TABLES = (
    ("Base parameters", "base parameter", (2, 3, 4, 5, 6, 7, 8)),
    ("Bodies, about the origin of each link's frame", "body", (1, 2, 4, 8)),
    ("Drives", "drive", (1, 2, 4, 8)),
)


def table_rows(model: IdentifiedModel) -> Iterator[Row]:
    """All rows of a model."""
    for p in model.parameters:
        interval = p.interval if p.interval is not None else (None, None)
        yield ("base parameter", "", p.name, p.expression, p.value, p.deviation, *interval, p.unit)
    places = ((body, k) for body in model.robot.bodies for k in range(PARAMETERS_PER_LINK))
    for column, (body, k) in zip(inertial_columns(model.robot), places, strict=True):
        if body.theta is not None:
            yield ("body", body.name, column.name, "", float(body.theta[k]), *_UNKNOWN, column.unit)
    for drive, linear in zip(model.drives, linear_drives(model.robot), strict=True):
        known = {ROTOR: drive.rotor_inertia, COULOMB: drive.coulomb, VISCOUS: drive.viscous, **drive.beyond}
        for kind, value in known.items():
            if value is not None and kind not in (TEMPERATURE, TABLE):
                column = drive_column(drive.number, kind, linear=linear)
                yield ("drive", drive.name, column.name, "", value, *_UNKNOWN, column.unit)


def _text(value: str | float | None, form: str = "") -> str:
    """A cell: a number with every digit, or in a format; empty where there is none."""
    if value is None or isinstance(value, str):
        return value or ""
    return format(value, form) if form else repr(float(value))


def sections(model: IdentifiedModel) -> Iterator[tuple[str, list[str], list[list[str]]]]:
    """Titles, heads and rows of the tables for readers, numbers with six digits; none is empty."""
    rows = list(table_rows(model))
    for title, part, places in _TABLES:
        if cells := [[_text(row[k], ".6g") for k in places] for row in rows if row[0] == part]:
            yield title, ["parameter" if HEAD[k] == "name" else HEAD[k] for k in places], cells


class CsvTable(ModelFormat):
    """Comma-separated values [RFC 4180] below comment lines that begin with ``#``."""

    name = "CSV"
    suffix = ".csv"
    expresses = LISTED

    def text(self, model: IdentifiedModel, comment: tuple[str, ...], robot_file: Path | None = None) -> ModelText:
        """See `excite.export.models.export_model.ModelFormat.text`."""
        stream = io.StringIO()
        stream.writelines(f"# {line}\n" for line in comment)
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(HEAD)
        writer.writerows(map(_text, row) for row in table_rows(model))
        return ModelText(stream.getvalue())


_ESCAPES = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    **{letter: f"\\{letter}" for letter in "#$%&_"},
}


class LatexTable(ModelFormat):
    r"""Tables of LaTeX to ``\input``, by the package longtable, numbers with six digits."""

    name = "LaTeX"
    suffix = ".tex"
    expresses = LISTED

    def text(self, model: IdentifiedModel, comment: tuple[str, ...], robot_file: Path | None = None) -> ModelText:
        """See `excite.export.models.export_model.ModelFormat.text`."""
        notes = (SIX_DIGITS, r"the LaTeX tables need \usepackage{longtable}")
        lines = [f"% {line}" for line in (*comment, *notes)]
        for title, head, rows in sections(model):
            lines += [rf"\begin{{longtable}}{{{'l' * len(head)}}}"]
            lines += [rf"\caption{{{title} of {_latex_escaped(model.described.name)}}}\\"]
            lines += [r"\hline", _latex_row(head), r"\hline", r"\endhead"]
            lines += [*(_latex_row(map(_latex_escaped, row)) for row in rows), r"\hline", r"\end{longtable}"]
        return ModelText("\n".join([*lines, ""]), notes)


def _latex_row(cells: Iterable[str]) -> str:
    return " & ".join(cell.replace("99 %", r"99\,\%") if cell.startswith("99 ") else cell for cell in cells) + r" \\"


def _latex_escaped(text: str) -> str:
    return "".join(_ESCAPES.get(letter, letter) for letter in text)


class MarkdownTable(ModelFormat):
    """Tables of GitHub Flavored Markdown, numbers with six digits."""

    name = "Markdown"
    suffix = ".md"
    expresses = LISTED

    def text(self, model: IdentifiedModel, comment: tuple[str, ...], robot_file: Path | None = None) -> ModelText:
        """See `excite.export.models.export_model.ModelFormat.text`."""
        lines = [f"# Identified parameters of {_markdown_escaped(model.described.name)}", ""]
        lines += [*(f"- {_markdown_escaped(line)}" for line in (*comment, SIX_DIGITS)), ""]
        for title, head, rows in sections(model):
            lines += [f"## {title}", "", _markdown_row(head), _markdown_row(["---"] * len(head))]
            lines += [*(_markdown_row(map(_markdown_escaped, row)) for row in rows), ""]
        return ModelText("\n".join(lines), (SIX_DIGITS,))


def _markdown_row(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _markdown_escaped(text: str) -> str:
    return re.sub(r"([\\`*_\[\]<>|])", r"\\\1", text)
