"""Identified drives as the actuator configuration of Isaac Lab.

Isaac Lab 2.3 documentation, ``isaaclab.actuators.ImplicitActuatorCfg``: ``joint_names_expr``, ``effort_limit_sim``,
``velocity_limit_sim``, ``armature``, ``friction`` (static), ``dynamic_friction`` and ``viscous_friction``, each by
joint name; from Isaac Sim 5.0 on the frictions are efforts [Nm or N], the viscous one [Nm s/rad or N s/m].
"""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

from excite.export.models.exported_model import number
from excite.export.models.identified_model import IdentifiedModel
from excite.export.models.model_format import ModelFormat, ModelText
from regressors.models.columns import COULOMB, ROTOR, VISCOUS

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
        """See `excite.export.models.model_format.ModelFormat.text`."""
        robot = model.robot
        columns = {
            "effort_limit_sim": dict(enumerate(robot.limits.torque.tolist())),
            "velocity_limit_sim": dict(enumerate(robot.limits.velocity.tolist())),
            "armature": {k: model.armature(k) for k in range(robot.n)},
            "friction": {k: model.friction(k) for k in range(robot.n)},
            "dynamic_friction": {k: model.friction(k) for k in range(robot.n)},
            "viscous_friction": {k: model.damping(k) for k in range(robot.n)},
        }
        expressions = ", ".join(json.dumps(re.escape(name), ensure_ascii=False) for name in robot.joint_names)
        lines = [f"# {line}" for line in (*comment, *_NOTES)]
        lines += ["actuators:", "  identified:", "    class_type: ImplicitActuatorCfg"]
        lines += [f"    joint_names_expr: [{expressions}]", "    stiffness: null", "    damping: null"]
        for field, values in columns.items():
            lines += [f"    {field}:", *_entries(values, robot.joint_names)] if _known(values) else []
        return ModelText("\n".join([*lines, ""]), _NOTES)


def _known(values: dict[int, float | None]) -> dict[int, float]:
    return {k: value for k, value in values.items() if value is not None and math.isfinite(value)}


def _entries(values: dict[int, float | None], names: tuple[str, ...]) -> list[str]:
    return [
        f"      {json.dumps(re.escape(names[k]), ensure_ascii=False)}: {_decimal(value)}"
        for k, value in _known(values).items()
    ]


def _decimal(value: float) -> str:
    """Number that every YAML reader takes for one: with a point, also before an exponent."""
    mantissa, exponent, power = number(value).partition("e")
    return f"{mantissa if '.' in mantissa else f'{mantissa}.0'}{exponent}{power}"
