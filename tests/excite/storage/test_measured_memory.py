"""Predicted memory is within a factor of three of the measured peak, and the cap holds under a limit of the system."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from commands import ENVIRONMENT

pytestmark = pytest.mark.slow
FACTOR = 3.0

# each prints what is predicted, and runs; `size` is the only free number
WORK = {
    "design, rate": (
        "task = Task('irp6', harmonics=3, starts=1, executor='serial', rate=float(size))\n"
        "predicted = design_prediction(target_of(installed_robot(task), task), task)\n"
        "design_trajectory(task).save('out')\n",
        (100, 50_000),
    ),
    "design, harmonics": (
        "task = Task('irp6', harmonics=size, starts=1, executor='serial')\n"
        "robot = installed_robot(task)\n"
        "predicted = design_prediction(target_of(robot, task), task)\n"
        "problem = formulate(robot, task).problem\n"
        "candidates(problem, 0, np.random.default_rng(0))\n",
        (5, 120),
    ),
    "simulate": (
        "task = Task('irp6', harmonics=3, starts=1, executor='serial')\n"
        "design = design_trajectory(task)\n"
        "settings = SimulationSettings(rate=float(size))\n"
        "predicted = simulation_prediction(settings, 10.4, 3, wrench=False)\n"
        "simulate(design, settings).save('run.csv')\n",
        (500, 20_000),
    ),
    "friction plan": (
        "schedule, robot = Schedule(warm_up=float(size)), built_in('irp6')\n"
        "predicted = plan_prediction(robot, schedule, 1)\n"
        "plan_friction(robot, schedule, drives=['1']).save('out')\n",
        (30, 2000),
    ),
    "read a log": (
        "table = np.column_stack([np.arange(size) * 1e-3, np.random.default_rng(0).normal(size=(size, 6))])\n"
        "with open('log.csv', 'w') as stream:\n"
        "    stream.write('time,' + ','.join(f'{k}.position' for k in range(6)) + '\\n')\n"
        "    for row in table:\n"
        "        stream.write(','.join(map(repr, row.tolist())) + '\\n')\n"
        "del table\n"
        "with text_of(Path('log.csv')) as text:\n"
        "    layout = house_layout('log.csv', header_names(text.lines[0]), None)\n"
        "    predicted = rows_in_memory(text.source, layout, size)\n"
        "read_log('log.csv')\n",
        (10_000, 400_000),
    ),
}
HEAD = """
import json, sys
from pathlib import Path
import numpy as np
from excite.design.blueprint import design_prediction
from excite.design.formulation import formulate
from excite.design.initial_guesses import candidates
from excite.design.optimisation import design_trajectory
from excite.design.friction_runs.plan_friction import plan_friction
from excite.design.friction_runs.schedule import plan_prediction
from excite.design.friction_runs.schedule import Schedule
from excite.information.target import target_of
from excite.logs.layout import house_layout
from excite.logs.log_reading import read_log
from excite.logs.table import rows_in_memory
from excite.logs.text import text_of
from excite.storage.sampled_motion import header_names
from excite.simulation.settings import SimulationSettings
from excite.simulation.simulate import simulate
from excite.simulation.simulate import simulation_prediction
from excite.tasks.robot_of_task import installed_robot
from excite.tasks.task import Task
from regressors.readers.library import built_in
size = int(sys.argv[1])
"""
# not of getrusage, where a new process begins with the peak of the one that started it
PEAK = "int(next(line for line in open('/proc/self/status') if line.startswith('VmHWM')).split()[1])"
TAIL = f"print(json.dumps([predicted.bytes, 1e3 * {PEAK}]))\n"


@pytest.mark.parametrize(("work", "size"), [(work, size) for work, (_, sizes) in WORK.items() for size in sizes])
def test_predictions_are_near_the_measured_peak(tmp_path: Path, work: str, size: int) -> None:
    script = HEAD + WORK[work][0] + TAIL
    ended = subprocess.run(
        [sys.executable, "-c", script, str(size)], cwd=tmp_path, env=ENVIRONMENT, capture_output=True, check=True
    )
    predicted, peak = json.loads(ended.stdout.splitlines()[-1])
    assert 1 / FACTOR < predicted / peak < FACTOR


def limited(arguments: list[str], cwd: Path, most: int) -> subprocess.CompletedProcess[str]:
    """Run ``excite ...`` with a limit on its address space [bytes]."""
    shell = ["sh", "-c", f'ulimit -v {most // 1024} && exec "$@"', "sh"]  # not preexec_fn: this process may be larger
    return subprocess.run(
        [*shell, sys.executable, "-m", "excite", *arguments],
        cwd=cwd,
        env={**ENVIRONMENT, "EXCITE_MEMORY_CAP": "0.5"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


@pytest.mark.parametrize("factor", [0.9, 100.0])
def test_a_cap_below_a_limit_of_the_system_is_never_passed(tmp_path: Path, factor: float) -> None:
    refused = limited(["friction", "plan", "irp6", "--warm-up", "1e5", "--out", "out"], tmp_path, 3 * 10**9)
    assert refused.returncode == 2
    found = re.search(r"--warm-up (\d+) would do", refused.stderr)
    assert found is not None
    seconds = factor * float(found[1])
    arguments = ["friction", "plan", "irp6", "--drives", "1", "--warm-up", f"{seconds:g}", "--out", "out"]
    ended = limited(arguments, tmp_path, 3 * 10**9)
    assert ended.returncode == (0 if factor < 1 else 2), ended.stderr
    assert "not enough memory" not in ended.stderr


def test_a_long_log_is_held_once(tmp_path: Path) -> None:
    rows = 300_000
    names = ",".join(f"{k}.{what}" for k in range(6) for what in ("position", "velocity", "effort"))
    some = [",".join(f"{x:.15g}" for x in row) for row in np.random.default_rng(0).normal(size=(1000, 18))]
    with (tmp_path / "log.csv").open("w") as stream:
        stream.write(f"time,{names}\n")
        stream.writelines(f"{1e-3 * k:.6f},{some[k % 1000]}\n" for k in range(rows))
    script = f"from excite.logs.log_reading import read_log\nread_log('log.csv', drop=['truncated'])\nprint({PEAK})"
    ended = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, env=ENVIRONMENT, capture_output=True, check=True
    )
    numbers = rows * 19 * 8
    assert 1e3 * int(ended.stdout) < 8e7 + 2.6 * numbers  # the file has 2.2 times the bytes of its numbers
