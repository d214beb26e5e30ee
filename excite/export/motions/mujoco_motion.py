"""Arrays for MuJoCo, by joint."""

from __future__ import annotations

import io

import numpy as np

from excite.export.motions.certificate import Interpolation
from excite.export.motions.motion_arrays import ARRAY_SAMPLES, motion_arrays
from excite.export.motions.motion_format import MotionFile, MotionFormat
from excite.export.motions.recorder import Recorder, house_recorder
from excite.export.motions.sampled_design import SampledDesign


class MujocoMotion(MotionFormat):
    """``qpos``, ``qvel``, ``qacc``, ``ctrl`` (N, n), the column of each joint by ``joint_names``, and ``time`` (N,).

    In a model, the column of ``joint_names[k]`` belongs at ``model.joint(name).qposadr`` and ``.dofadr``; ``ctrl`` is
    the position that actuators of the type position take.
    """

    name = "mujoco"
    suffix = ".npz"
    default_rate, fastest = 500.0, 1e6
    most = ARRAY_SAMPLES
    revolute = False
    interpolation = Interpolation.NONE
    checked = "when excite is tested, such arrays are set in a model of MuJoCo by the names of its joints"

    def file(self, motion: SampledDesign, stem: str) -> MotionFile:
        """The archive, uncompressed."""
        arrays = motion_arrays(motion)
        named = {new: arrays.pop(old) for new, old in (("qpos", "q"), ("qvel", "dq"), ("qacc", "ddq"))}
        stream = io.BytesIO()
        np.savez(stream, allow_pickle=False, **named, ctrl=named["qpos"], **arrays)
        apart = f"samples are {1.0 / motion.rate:g} s apart: choose a timestep of the model that divides that"
        return MotionFile(stream.getvalue(), (apart,))

    def recorder(self, motion: SampledDesign, name: str) -> Recorder:
        """CSV as of `excite simulate`, of ``data.qpos``, ``data.qvel`` and ``data.qfrc_actuator``."""
        return house_recorder(motion)
