"""Arrays of a motion, for formats that hold arrays."""

from __future__ import annotations

from typing import Any

import numpy as np

from excite.export.motions.sampled_design import SampledDesign

ARRAY_SAMPLES = 500_000


def motion_arrays(motion: SampledDesign) -> dict[str, Any]:
    """``time`` (N,) [s]; ``q``, ``dq``, ``ddq`` (N, n) [SI]; names; hashes; nothing that needs pickle."""
    samples = motion.samples
    return {
        "time": samples.time,
        "q": samples.q,
        "dq": samples.dq,
        "ddq": samples.ddq,
        "joint_names": np.array(motion.joints),
        "segment": np.array(motion.segments),
        "rate": np.array(motion.rate),
        "robot": np.array(motion.robot.name),
        "design_sha256": np.array(motion.design.file_sha256 or ""),
        "coefficients_sha256": np.array(motion.design.coefficients_sha256),
    }
