"""Identified models as NumPy arrays in the conventions of Pinocchio.

Pinocchio's `Inertia` has mass, lever (the centre of mass) and rotational inertia about it; `toDynamicParameters` is
(m, mcx, mcy, mcz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz) about the joint's frame. `Model.rotorInertia`, `rotorGearRatio`,
`damping`, `friction` and `armature` have one entry per joint.
"""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from excite.export.models.exported_model import about_centre
from excite.export.models.identified_model import IdentifiedModel
from excite.export.models.model_feature import COUPLED
from excite.export.models.model_format import ModelFormat, ModelText
from regressors.models.columns import COULOMB, ROTOR, VISCOUS
from regressors.robot.inertia import PARAMETERS_PER_LINK
from regressors.samples import Array

_PINOCCHIO = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]  # its order of the ten parameters
_OLDEST = (1980, 1, 1, 0, 0, 0)  # of every member, so that the same model gives the same bytes


class NpzFormat(ModelFormat):
    """NumPy arrays, read by ``numpy.load(file, allow_pickle=False)``."""

    name = "NPZ"
    suffix = ".npz"
    expresses = frozenset({ROTOR, COULOMB, VISCOUS, COUPLED})

    def text(self, model: IdentifiedModel, comment: tuple[str, ...], robot_file: Path | None = None) -> ModelText:
        """See `excite.export.models.model_format.ModelFormat.text`."""
        stream = io.BytesIO()
        with zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as archive:
            for name, values in arrays(model, comment).items():
                member = io.BytesIO()
                np.lib.format.write_array(member, np.asarray(values), allow_pickle=False)
                archive.writestr(zipfile.ZipInfo(f"{name}.npy", _OLDEST), member.getvalue())
        return ModelText(stream.getvalue())


def arrays(model: IdentifiedModel, comment: tuple[str, ...]) -> dict[str, Any]:
    """Arrays of the file by their names."""
    robot, n = model.robot, range(model.robot.n)
    bodies = [_body(link.theta) for link in robot.links]
    one = [drives[0] if len(drives := model.joint_drives(k)) == 1 else None for k in n]
    return {
        "comment": np.array(comment),
        "robot": np.array(model.described.name),
        "joint_names": np.array(robot.joint_names),
        "link_names": np.array([link.name for link in robot.links]),
        "mass": np.array([mass for mass, _, _ in bodies]),
        "lever": np.array([centre for _, centre, _ in bodies]),
        "inertia": np.array([inertia for _, _, inertia in bodies]),
        "dynamic_parameters": np.array([_theta(link.theta)[_PINOCCHIO] for link in robot.links]),
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


def _theta(theta: Array | None) -> Array:
    return np.full(PARAMETERS_PER_LINK, np.nan) if theta is None else theta


def _body(theta: Array | None) -> tuple[float, Array, Array]:
    return (np.nan, np.full(3, np.nan), np.full((3, 3), np.nan)) if theta is None else about_centre(theta)
