"""Small designs, saved and loaded, for the tests of exports: made once."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path

import excite
from excite.design.stored_design import StoredDesign


@cache
def _folder() -> Path:
    return Path(tempfile.mkdtemp(prefix="excite-exported-"))


def _stored(name: str, *given: object, **options: object) -> StoredDesign:
    design = excite.design_trajectory(*given, search=excite.Search(starts=1, executor="serial"), **options)  # type: ignore[arg-type]
    design.save(_folder() / name)
    return excite.load_design(_folder() / name)


@cache
def ur10e() -> StoredDesign:
    """Three of six joints excite, all of them approach and return; no accelerations are limited."""
    return _stored(
        "ur10e",
        "ur10e",
        joints=("2", "3", "4"),
        trajectory=excite.TrajectoryChoice(harmonics=2, period=4.0),
        limits=excite.LimitChoice(torque_margin=None),
        output=excite.Output(rate=50.0, home=(0.0, -1.5, 1.5, 0.0, 0.0, 0.0), settle=0.1),
    )


@cache
def panda() -> StoredDesign:
    """One of seven joints excites, with limits of acceleration and jerk; all of them approach and return."""
    velocity = (2.0,) * 4 + (2.4,) * 3  # slow enough for libfranka
    return _stored(
        "panda",
        "panda",
        joints=("panda_joint6",),
        trajectory=excite.TrajectoryChoice(harmonics=2, period=4.0),
        limits=excite.LimitChoice(velocity=velocity, torque_margin=None),
        output=excite.Output(rate=50.0, home=(0.0, -0.5, 0.0, -2.0, 0.0, 1.5, 0.8), settle=0.1),
    )


@cache
def irp6() -> StoredDesign:
    """Three of five joints move, without approach and return."""
    return _stored("irp6", "irp6", trajectory=excite.TrajectoryChoice(harmonics=3, period=2.0))
