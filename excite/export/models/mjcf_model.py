"""Identified models as MJCF: a copy of the user's own file, or one written from the description."""

from __future__ import annotations

from pathlib import Path

from excite.export.models.identified_model import IdentifiedModel
from excite.export.models.mjcf_copy import mjcf_copy
from excite.export.models.mjcf_text import mjcf_notes, mjcf_text
from excite.export.models.model_feature import COUPLED
from excite.export.models.model_format import ModelFormat, ModelText
from regressors.models.columns import COULOMB, ROTOR, VISCOUS

_ZONE = (
    "MuJoCo's friction loss is a soft constraint: in a stick zone around standstill it is less than Coulomb friction; "
    "solreffriction and solimpfriction of the joints set how wide that is"
)


class MjcfFormat(ModelFormat):
    """MJCF [MuJoCo, XML reference]: inertia, armature, damping and friction loss; coupled drives as fixed tendons."""

    name = "MJCF"
    suffix = ".xml"
    expresses = frozenset({ROTOR, COULOMB, VISCOUS, COUPLED})
    template_suffixes = (".xml", ".mjcf")

    def text(self, model: IdentifiedModel, comment: tuple[str, ...], robot_file: Path | None = None) -> ModelText:
        """See `excite.export.models.model_format.ModelFormat.text`."""
        zone = (_ZONE,) if any(feature.kind == COULOMB for feature in model.features) else ()
        if robot_file is not None:
            copy = mjcf_copy(model, robot_file)
            notes = (*copy.notes, *zone)
            return ModelText(copy.content((*comment, *notes)), notes)
        notes = (*mjcf_notes(model.robot), *zone)
        return ModelText(mjcf_text(model, (*comment, *notes)), notes)
