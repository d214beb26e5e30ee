"""Small designs for the tests: searched in no time, saved and loaded once, or copied into the cells of a sweep."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from written_files import saved, text_file

import excite
from excite.design.design import Design
from excite.design.design_folder import design_content
from excite.design.formulation import formulate
from excite.design.optimisation import solve
from excite.design.sweeps.cell import CELLS, Cell, cell_identities
from excite.storage.migrations import schema_of
from excite.tasks.task import Task
from regressors.readers.library import load_robot


@cache
def _folder() -> Path:
    return Path(tempfile.mkdtemp(prefix="excite-exported-"))


def _stored(name: str, *given: object, **options: object) -> Design:
    design = excite.design_trajectory(*given, search=excite.Search(starts=1, executor="serial"), **options)  # type: ignore[arg-type]
    return excite.load_design(saved(_folder() / name, design, replace=True))


NO_DISTANCES: dict[str, Any] = {"self_collision": False, "floor": "none"}


@cache
def ur10e() -> Design:
    """Three of six joints excite, all of them approach and return; no accelerations are limited."""
    return _stored(
        "ur10e",
        "ur10e",
        joints=("2", "3", "4"),
        trajectory=excite.TrajectoryChoice(harmonics=2, period=4.0),
        limits=excite.LimitChoice(torque_margin=None, **NO_DISTANCES),
        output=excite.Output(rate=50.0, home=(0.0, -1.5, 1.5, 0.0, 0.0, 0.0), settle=0.1),
    )


@cache
def panda() -> Design:
    """One of seven joints excites, with limits of acceleration and jerk, none of distances; all approach and return."""
    velocity = (2.0,) * 4 + (2.4,) * 3  # slow enough for libfranka
    return _stored(
        "panda",
        "panda",
        joints=("panda_joint6",),
        trajectory=excite.TrajectoryChoice(harmonics=2, period=4.0),
        limits=excite.LimitChoice(velocity=velocity, torque_margin=None, **NO_DISTANCES),
        output=excite.Output(rate=50.0, home=(0.0, -0.5, 0.0, -2.0, 0.0, 1.5, 0.8), settle=0.1),
    )


@cache
def irp6() -> Design:
    """Three of five joints move, without approach and return."""
    return _stored("irp6", "irp6", trajectory=excite.TrajectoryChoice(harmonics=3, period=2.0))


PLANAR = """<robot name="planar"><link name="base"/>
<link name="upper"><inertial><origin xyz="0.2 0 0"/><mass value="3"/>
<inertia ixx="0.02" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="fore"><inertial><origin xyz="0.15 0.02 0"/><mass value="2"/>
<inertia ixx="0.01" iyy="0.03" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j1" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
<origin rpy="1.5707963267948966 0 0"/><limit lower="-2.5" upper="2.5" velocity="2" effort="100"/></joint>
<joint name="j2" type="revolute"><parent link="upper"/><child link="fore"/><axis xyz="0 0 1"/>
<origin xyz="0.4 0 0"/><limit lower="-2.5" upper="2.5" velocity="3" effort="60"/></joint></robot>"""


@cache
def planar(family: str, seed: int = 0, jerk: float = 100.0, rate: float = 100.0) -> Design:
    """Two joints from home and back, with limits of acceleration and jerk; periods, homes and limits by the seed."""
    rng = np.random.default_rng(seed)
    urdf = text_file(_folder() / "planar.urdf", PLANAR)
    return _stored(
        f"{family}-{seed}-{jerk:g}-{rate:g}",
        str(urdf),
        trajectory=excite.TrajectoryChoice(family, period=round(rng.uniform(3.0, 6.0) * rate) / rate, harmonics=4),
        limits=excite.LimitChoice(acceleration=(float(rng.uniform(3.0, 10.0)),), jerk=(jerk,), torque_margin=None),
        output=excite.Output(rate=rate, home=tuple(rng.uniform(-1.0, 1.0, 2).round(3).tolist()), settle=0.1),
    )


@cache
def short() -> excite.Design:
    """Of 4 s for the IRp-6, from one start."""
    return excite.design_trajectory("irp6", period=4, search=excite.Search(starts=1, executor="serial"))


@cache
def _content(folder: str) -> str:
    task = Task("irp6", harmonics=3, starts=1, executor="serial")
    robot = load_robot("irp6")
    return json.dumps(design_content(solve(robot, formulate(robot, task), Path(folder))))


def copies(cells: Sequence[Cell], root: Path, change: Callable[[int, dict[str, Any]], None]) -> None:
    """Write a design into every cell's folder.

    Parameters
    ----------
    cells : sequence of Cell
    root : Path
        Of the sweep; its parent holds the starts of the design that is copied.
    change : callable
        Changes the content of ``design.json`` of a cell by its number.
    """
    starts = root.parent / "copied"
    starts.mkdir(exist_ok=True)
    identities = cell_identities(cells)
    for number, cell in enumerate(cells):
        folder = root / CELLS / cell.name
        folder.mkdir(parents=True)
        content = json.loads(_content(str(starts)))
        change(number, content)
        record = {"schema": schema_of("cell"), "sha256": identities[cell.name], "status": "", "reason": ""}
        (folder / "design.json").write_text(json.dumps(content))
        (folder / "cell.json").write_text(json.dumps({**record, "search": cell.task.search.extent}))
