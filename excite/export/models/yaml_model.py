"""Identified models as robot YAML, which `excite.load_robot` reads."""

from __future__ import annotations

from pathlib import Path

from excite.export.models.identified_model import IdentifiedModel
from excite.export.models.model_feature import BRANCHES, COUPLED, VARYING
from excite.export.models.model_format import ModelFormat, ModelText
from excite.files.robot_yaml import robot_text
from regressors.models.columns import COULOMB, ROTOR, VISCOUS


class YamlFormat(ModelFormat):
    """Robot YAML: bodies, drives with their coupling and gears, Coulomb and viscous friction, limits."""

    name = "robot YAML"
    suffix = ".yaml"
    expresses = frozenset({ROTOR, COULOMB, VISCOUS, COUPLED, VARYING, BRANCHES})

    def text(self, model: IdentifiedModel, comment: tuple[str, ...], robot_file: Path | None = None) -> ModelText:
        """See `excite.export.models.model_format.ModelFormat.text`."""
        robot = model.robot.replace(source=f"{model.described.source}, with identified parameters")
        return ModelText("".join(f"# {line}\n" for line in comment) + robot_text(robot))
