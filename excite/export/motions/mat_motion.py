"""Arrays for MATLAB, in a MAT-file of level 5."""

from __future__ import annotations

import io

import numpy as np

from excite.export.motions.certificate import Interpolation
from excite.export.motions.motion_arrays import ARRAY_SAMPLES, motion_arrays
from excite.export.motions.motion_format import MotionFile, MotionFormat
from excite.export.motions.recorder import Recorder, house_recorder
from excite.export.motions.sampled_design import SampledDesign

_HEAD = 116  # bytes of text at the head of the file, which SciPy fills with platform and date


class MatMotion(MotionFormat):
    """``time`` (N, 1), ``q``, ``dq``, ``ddq`` (N, n), cells ``joint_names`` and texts of the hashes."""

    name = "mat"
    suffix = ".mat"
    default_rate, fastest = 1000.0, 1e6
    most = ARRAY_SAMPLES
    revolute = False
    interpolation = Interpolation.NONE
    checked = "when excite is tested, scipy.io reads such files back; MATLAB itself has not"

    def file(self, motion: SampledDesign, stem: str) -> MotionFile:
        """The file, without the date that SciPy writes."""
        from scipy.io import savemat

        arrays = motion_arrays(motion)
        names = np.array(arrays.pop("joint_names").tolist(), dtype=object)
        numbers = {of: {"approach": 1, "excite": 2, "return": 3}[of] for of in sorted(set(motion.segments))}
        arrays["segment"] = np.array([numbers[of] for of in motion.segments], dtype=np.uint8)
        texts = {name: str(arrays.pop(name)) for name in ("robot", "design_sha256", "coefficients_sha256")}
        stream = io.BytesIO()
        savemat(stream, {**arrays, **texts, "joint_names": names}, oned_as="column")
        head = f"MATLAB 5.0 MAT-file, coefficients sha256 {motion.design.coefficients_sha256}".encode().ljust(_HEAD)
        return MotionFile(
            head + stream.getvalue()[_HEAD:], ("segment is 1 on the approach, 2 while it excites, 3 on the return",)
        )

    def recorder(self, motion: SampledDesign, name: str) -> Recorder:
        """CSV as of `excite simulate`."""
        return house_recorder(motion)
