"""Files for the tests of ``excite identify`` and ``excite verify``: a design, and logs of its motion and of others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from played import LOAD, AtRest, curves, irp6, noisy, periodic, played, three_joints

from excite.design.optimisation import design_trajectory
from excite.files.design_folder import save_design
from excite.files.design_json import load_design
from excite.logs.log_reading import write_log
from excite.tasks.task import Task

FRICTION = "schema: excite.friction/1\ndrives:\n" + "".join(
    f"  {name}: {{model: coulomb-viscous, coulomb: {curve.coulomb}, viscous: {curve.viscous}}}\n"
    for name, curve in curves().items()
)


def write_files(folder: Path) -> None:
    """``design``; ``run.csv`` and ``again.csv`` of it, ``other.csv``, ``load.csv`` of other motions; friction."""
    task = Task("irp6", period=4.0, harmonics=3, starts=1, executor="serial")
    save_design(design_trajectory(task.changed(robot=irp6())), folder / "design")
    motion = AtRest(load_design(folder / "design").trajectory)
    for seed, name in enumerate(("run", "again")):
        write_log(noisy(played(motion, 3, 100.0, 4.01), 0.2, 1e-6, seed), folder / f"{name}.csv")
    write_log(noisy(played(three_joints(), 3), 0.2, 1e-6, 2), folder / "other.csv")
    write_log(played(periodic(np.eye(5), 3), 5, load=LOAD), folder / "load.csv")
    (folder / "friction.yaml").write_text(FRICTION, encoding="utf-8")


def link_files(files: Path, folder: Path) -> None:
    """The same files in the folder of one test."""
    for path in files.iterdir():
        (folder / path.name).symlink_to(path)
