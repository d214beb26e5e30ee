"""Identified models as URDF: a copy of the user's own file, or one written from the description."""

from __future__ import annotations

from pathlib import Path

from excite.export.models.identified_model import IdentifiedModel
from excite.export.models.model_format import ModelFormat, ModelText
from excite.export.models.urdf_copy import urdf_copy
from excite.export.models.urdf_text import urdf_notes, urdf_text
from regressors.models.columns import COULOMB, VISCOUS


class UrdfFormat(ModelFormat):
    """URDF [ROS wiki, urdf/XML/link, urdf/XML/joint]: inertia of links, ``<dynamics damping friction>`` of joints."""

    name = "URDF"
    suffix = ".urdf"
    expresses = frozenset({COULOMB, VISCOUS})
    template_suffixes = (".urdf", ".xml")

    def text(self, model: IdentifiedModel, comment: tuple[str, ...], robot_file: Path | None = None) -> ModelText:
        """See `excite.export.models.model_format.ModelFormat.text`."""
        if robot_file is not None:
            copy = urdf_copy(model, robot_file)
            return ModelText(copy.content((*comment, *copy.notes)), copy.notes)
        notes = urdf_notes(model.robot)
        return ModelText(urdf_text(model, (*comment, *notes), lambda _: (), {}), notes)
