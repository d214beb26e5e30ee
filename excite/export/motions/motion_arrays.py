"""Arrays of a motion for NumPy, MATLAB and MuJoCo."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from scipy.io import savemat

from excite.export.motions.motion_format import Interpolation, MotionFile, MotionFormat, Recorder, house_recorder
from excite.export.motions.sampled_design import SEGMENTS, SampledDesign

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


class _Arrays(MotionFormat):
    """Arrays of NumPy, uncompressed."""

    suffix = ".npz"
    default_rate, fastest = 1000.0, 1e6
    most = ARRAY_SAMPLES
    revolute = False
    interpolation = Interpolation.NONE

    def recorder(self, motion: SampledDesign, name: str) -> Recorder:
        """CSV as of `excite simulate`; of MuJoCo ``data.qpos``, ``data.qvel`` and ``data.qfrc_actuator``."""
        return house_recorder(motion)


class NpzMotion(_Arrays):
    """``time`` (N,), ``q``, ``dq``, ``ddq`` (N, n), ``joint_names``, ``segment``, and the hashes, without pickle."""

    name = "npz"
    checked = "when excite is tested, NumPy reads such files back"

    def file(self, motion: SampledDesign, stem: str) -> MotionFile:
        """The archive, uncompressed."""
        return MotionFile(_archive(motion_arrays(motion)))


_HEAD = 116  # bytes of text at the head of the file, which SciPy fills with platform and date


class MatMotion(_Arrays):
    """``time`` (N, 1), ``q``, ``dq``, ``ddq`` (N, n), cells ``joint_names`` and texts of the hashes."""

    name = "mat"
    suffix = ".mat"
    checked = "when excite is tested, scipy.io reads such files back; MATLAB itself has not"

    def file(self, motion: SampledDesign, stem: str) -> MotionFile:
        """The file, without the date that SciPy writes."""
        arrays = motion_arrays(motion)
        names = np.array(arrays.pop("joint_names").tolist(), dtype=object)
        arrays["segment"] = np.array([SEGMENTS[of] for of in motion.segments], dtype=np.uint8)
        texts = {name: str(arrays.pop(name)) for name in ("robot", "design_sha256", "coefficients_sha256")}
        stream = io.BytesIO()
        savemat(stream, {**arrays, **texts, "joint_names": names}, oned_as="column")
        head = f"MATLAB 5.0 MAT-file, coefficients sha256 {motion.design.coefficients_sha256}".encode().ljust(_HEAD)
        note = "segment is 1 on the approach, 2 while it excites, 3 on the return"
        return MotionFile(head + stream.getvalue()[_HEAD:], (note,))


class MujocoMotion(_Arrays):
    """``qpos``, ``qvel``, ``qacc``, ``ctrl`` (N, n), the column of each joint by ``joint_names``, and ``time`` (N,).

    In a model, the column of ``joint_names[k]`` belongs at ``model.joint(name).qposadr`` and ``.dofadr``; ``ctrl`` is
    the position that actuators of the type position take.
    """

    name = "mujoco"
    default_rate = 500.0
    checked = "when excite is tested, such arrays are set in a model of MuJoCo by the names of its joints"

    def file(self, motion: SampledDesign, stem: str) -> MotionFile:
        """The archive, uncompressed."""
        arrays = motion_arrays(motion)
        named = {new: arrays.pop(old) for new, old in (("qpos", "q"), ("qvel", "dq"), ("qacc", "ddq"))}
        apart = f"samples are {1.0 / motion.rate:g} s apart: choose a timestep of the model that divides that"
        return MotionFile(_archive({**named, "ctrl": named["qpos"], **arrays}), (apart,))


def _archive(arrays: dict[str, Any]) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, allow_pickle=False, **arrays)
    return stream.getvalue()
