"""Arrays for NumPy."""

from __future__ import annotations

import io

import numpy as np

from excite.export.motions.certificate import Interpolation
from excite.export.motions.motion_arrays import ARRAY_SAMPLES, motion_arrays
from excite.export.motions.motion_format import MotionFile, MotionFormat
from excite.export.motions.recorder import Recorder, house_recorder
from excite.export.motions.sampled_design import SampledDesign


class NpzMotion(MotionFormat):
    """``time`` (N,), ``q``, ``dq``, ``ddq`` (N, n), ``joint_names``, ``segment``, and the hashes, without pickle."""

    name = "npz"
    suffix = ".npz"
    default_rate, fastest = 1000.0, 1e6
    most = ARRAY_SAMPLES
    revolute = False
    interpolation = Interpolation.NONE
    checked = "when excite is tested, NumPy reads such files back"

    def file(self, motion: SampledDesign, stem: str) -> MotionFile:
        """The archive, uncompressed."""
        stream = io.BytesIO()
        np.savez(stream, allow_pickle=False, **motion_arrays(motion))
        return MotionFile(stream.getvalue())

    def recorder(self, motion: SampledDesign, name: str) -> Recorder:
        """CSV as of `excite simulate`."""
        return house_recorder(motion)
