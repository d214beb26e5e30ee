"""Study 5: processor time and memory of an identification of a 7-axis arm, and time of the recursive update.

Each measurement is a fresh process with one BLAS thread; the log is a CSV file, as for any user. With the folder of the
real logs as argument, whole commands with all their choices instead, beside those of another checkout if it is given.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from importlib import import_module
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import record
from measure import script

HERE = Path(__file__).resolve().parent
LENGTHS, RUNS, SEED = (15, 30, 60, 120), 5, 0
RATE, PERIOD = 1000.0, 15.0
TORQUE_NOISE, POSITION_NOISE = 0.2, 1e-5  # Nm, rad
TURNS = 0.02  # rad/s, over which the friction of the second case turns
CASES = ((0.0, LENGTHS), (TURNS, (60,)))


def panda_log(path: str, seconds: int, width: float) -> dict[str, float]:
    """Write a log of the arm with noise, playing a random feasible motion of 15 s over and over; the true parameters.

    Parameters
    ----------
    path : str
    seconds : int
        A multiple of the period.
    width : float
        Velocity over which Coulomb friction turns; 0 for the exact sign [rad/s].
    """
    from excite.design.formulation import formulate
    from excite.design.initial_guesses import random_motion
    from excite.information.target import target_of
    from excite.logs.log import Log
    from excite.logs.log_reading import write_log
    from excite.tasks.reference import Repeated
    from excite.tasks.task import Task
    from regressors.models.nominal import parameter_values, standard_values
    from regressors.readers.library import load_robot

    robot, rng = load_robot("panda"), np.random.default_rng(SEED)
    task = Task("panda", offset=True, period=PERIOD)
    made, target = formulate(robot, task), target_of(robot, task, width)
    x = random_motion(made.problem, rng)
    motion = made.problem.information.trajectory(x)
    samples = Repeated(motion, round(seconds / PERIOD)).samples(np.arange(round(seconds * RATE) + 1) / RATE)
    friction = {f"F{k}{kind}": value for k in range(1, 8) for kind, value in (("c", 0.5), ("v", 0.3), ("o", 0.1))}
    beta = parameter_values(target.model, target.base, {**standard_values(robot), **friction})
    torque = (target.model.assemble(samples)[:, target.base.index] @ beta).reshape(-1, robot.n)
    log = Log(
        source=path,
        sha256="",
        joints=robot.joint_names,
        time=samples.time,
        q=samples.q + POSITION_NOISE * rng.standard_normal(samples.q.shape),
        effort=torque + TORQUE_NOISE * rng.standard_normal(torque.shape),
    )
    write_log(log, path)
    return dict(zip(target.base.names, beta.tolist(), strict=True))


def identification(path: str) -> dict[str, Any]:
    """Steps of ``excite identify`` without figures, in this process: processor time after each, and peak memory."""
    for module in ("identification.procedure", "logs.log_reading"):
        import_module(f"excite.{module}")

    from excite.identification.procedure import estimate_parameters
    from excite.identification.recipe import Recipe
    from excite.logs.log_reading import read_log
    from excite.tasks.task import Task
    from regressors.readers.library import load_robot

    marks = [0.0, time.process_time()]
    log = read_log(Path(path))
    marks.append(time.process_time())
    result = estimate_parameters(load_robot("panda"), Task("panda", offset=True), [log], Recipe())
    marks.append(time.process_time())
    steps = dict(zip(("imports", "reading", "identification"), np.diff(marks).tolist(), strict=True))
    return {
        **steps,
        "in all": marks[-1],
        "megabytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "rows": result.observations.W.shape[0],
        "sign_width": result.recipe.sign_width,
        "breakaway": result.recipe.breakaway,
        "names": list(result.estimate.names),
        "values": result.estimate.values.tolist(),
        "deviation": result.estimate.deviation.tolist(),
    }


def recursion(path: str) -> dict[str, Any]:
    """Processor time of the recursive estimator per instant and per row of the panda's log, and of an IRp-6's."""
    from excite.design.formulation import formulate
    from excite.design.initial_guesses import random_motion
    from excite.identification.equations import equations_of
    from excite.identification.estimators.least_squares import recursive
    from excite.identification.observations import Observations
    from excite.identification.preparation import prepare
    from excite.identification.recipe import Recipe
    from excite.information.target import target_of
    from excite.logs.log_reading import read_log
    from excite.tasks.task import Task
    from regressors.readers.library import load_robot

    robot, recipe = load_robot("panda"), Recipe(sign_width=0.0)
    target = target_of(robot, Task("panda", offset=True))
    panda = equations_of(target, prepare(read_log(Path(path)), robot, target, recipe), recipe)
    made, rng = formulate(load_robot("irp6"), Task("irp6")), np.random.default_rng(SEED)
    x = random_motion(made.problem, rng)
    motion = made.problem.information.trajectory(x)
    samples, model, base = motion.sampled(2000.0), made.target.model, made.target.base
    W = model.assemble(samples)[:, base.index]
    count, r = samples.time.size, len(model.row_labels)
    irp6 = Observations(
        W, W.sum(axis=1) + rng.standard_normal(len(W)), base.names, base.units, np.tile(np.arange(r), count),
        model.row_labels, np.zeros(len(W), dtype=np.intp), ("irp6",), np.repeat(samples.time, r),
    )  # fmt: skip
    found = {}
    for name, observations in (("irp6", irp6), ("panda", panda)):
        rows, equations = observations.y.size, len(observations.equations)
        began = time.process_time()
        recursive(observations)
        took = 1e6 * (time.process_time() - began)
        p = observations.W.shape[1]
        found[name] = {
            "parameters": p,
            "equations": equations,
            "rows": rows,
            "row": took / rows,
            "instant": took * equations / rows,
        }
    return found


MODES = {"log": panda_log, "identification": identification, "recursion": recursion}


def in_own_process(mode: str, **arguments: Any) -> Any:
    """What a mode of this script finds. A process starts with its parent's peak of memory, so this one stays small."""
    return script("identification/speed.py", {"mode": mode, **arguments}, threads=1).result


def spread(values: list[float], digits: int) -> str:
    """Median, lowest and highest."""
    low, middle, high = min(values), float(np.median(values)), max(values)
    return f"**{middle:.{digits}f}** ({low:.{digits}f}-{high:.{digits}f})"


def identification_row(case: dict[str, Any]) -> list[object]:
    """One line of the first table."""
    runs = case["runs"]
    first = runs[0]
    truth = np.array([case["truth"][name] for name in first["names"]])
    error = (np.array(first["values"]) - truth) / np.array(first["deviation"])
    case["rms_error_over_deviation"] = float(np.sqrt(np.mean(error**2)))
    each = 1e6 * float(np.median([run["identification"] for run in runs])) / (case["seconds"] * RATE)
    turning = f"{first['sign_width']:.2g} rad/s" if first["sign_width"] else "exact sign"
    if first["breakaway"]:
        turning = f"{first['breakaway']:.2g} rad"
    return [
        f"{case['seconds']} s",
        f"{case['width']:g} rad/s" if case["width"] else "exact sign",
        turning,
        first["rows"],
        *(spread([run[step] for run in runs], 2) for step in ("in all", "imports", "reading", "identification")),
        f"{each:.0f}",
        spread([run["megabytes"] for run in runs], 0),
        f"{case['rms_error_over_deviation']:.2f}",
    ]


HEAD = (
    "log", "friction turns over", "found", "equations", "CPU s, in all", "imports", "reading", "identification",
    "us per instant", "peak MB", "error / deviation",
)  # fmt: skip
RECURSIVE_HEAD = ("robot", "parameters", "equations per instant", "us per equation", "us per instant")

LIMITATIONS = (
    f"median of {RUNS} runs (lowest-highest), each a process of its own with one BLAS thread, file in the disk's cache",
    "Panda, 43 inertial base parameters and 21 of friction (Coulomb, viscous, offset), 1 kHz, all defaults of "
    "`excite identify` but figures and result file: search for the exciting rows, the filter's cutoff and how "
    "friction turns, weights, covariance, residuals",
    f"data made from the model with white noise ({TORQUE_NOISE:g} Nm, {POSITION_NOISE:g} rad) along a random motion",
    "error / deviation: root mean square over the 64 parameters; 1 where the stated deviations are right. They allow "
    "for the noise of the torques only, not for how friction turns, nor for what the noise of the positions does to "
    "the sign of a small velocity: such errors stay as the log grows and the deviations shrink",
    "wanted: 60 s in less than 5 s of processor time and 1.5 GB, in proportion to the length; recursive update in less "
    "than 50 us per sample; it is amortised over blocks of rows, and gives the estimate after every instant",
    "processor time on a shared machine varies by some ten per cent",
)


def main() -> None:
    """Logs, then every measurement."""
    before = record.load()
    cases, updates = [], []
    with tempfile.TemporaryDirectory() as folder:
        for width, lengths in CASES:
            for seconds in lengths:
                path = str(Path(folder) / f"{seconds}-{width:g}.csv")
                truth = in_own_process("log", path=path, seconds=seconds, width=width)
                runs = [in_own_process("identification", path=path) for _ in range(RUNS)]
                cases.append({"seconds": seconds, "width": width, "truth": truth, "runs": runs})
        shortest = str(Path(folder) / f"{LENGTHS[0]}-0.csv")
        updates = [in_own_process("recursion", path=shortest) for _ in range(RUNS)]
    rows = []
    for name in ("irp6", "panda"):
        each = [update[name] for update in updates]
        times = [spread([one[key] for one in each], 1) for key in ("row", "instant")]
        rows.append([name, each[0]["parameters"], each[0]["equations"], *times])
    text = "\n\n".join(
        [
            record.table(HEAD, [identification_row(case) for case in cases]),
            "The recursive estimator:",
            record.table(RECURSIVE_HEAD, rows),
        ]
    )
    record.save("speed", before, {"identification": cases, "recursion": updates}, text, LIMITATIONS, folder=HERE)


UR10E, KR300 = ("--mapping", str(HERE / "ur10e.yaml")), ("--mapping", str(HERE.parent / "real" / "kr300.yaml"))
COMMANDS = (  # name, robot, log, log to verify on, options
    ("UR10e, 50 s", "ur10e", "ur10e/ur-20_02_12-50sec_12harm.csv", "ur10e/ur-20_02_05-20sec_8harm.csv", UR10E),
    ("UR10e, 20 s", "ur10e", "ur10e/ur-20_02_05-20sec_8harm.csv", "ur10e/ur-20_02_12-40sec_12harm.csv", UR10E),
    ("KR300, A", "kr300/kr300.urdf", "kr300/A.csv", "kr300/B.csv", KR300),
    ("Panda, 15 s, simulated", "panda", "15.csv", "30.csv", ()),
)
COMMAND_RUNS = 1
COMMAND_HEAD = (
    "log",
    "rows",
    "code",
    "identify, CPU s",
    "wall s",
    "peak MB",
    "verify, CPU s",
    "wall s",
    "unseen error",
)
COMMAND_LIMITATIONS = (
    f"median of {COMMAND_RUNS} (lowest-highest) runs of `excite identify ROBOT LOG --figures none`, choices by the "
    "tool, and of `excite verify RESULT OTHER_LOG --figures none`; user and system time of the whole process, one BLAS "
    "thread, modules compiled before, one run after the other of each code",
    "unseen: error of the predicted torques of the other log; the simulated Panda is verified on 30 s of its motion",
    "wanted: 2000 to 5000 rows of six axes in 5 s, and 2.5 s to verify 2000 rows or 5 s for 20,000",
    "processor time on a shared machine varies by some ten per cent, and grows by up to a half under other load",
)


def command_run(checkout: Path, cache: Path, arguments: tuple[str, ...], module: str = "excite") -> dict[str, float]:
    """Times and peak memory of one command of a checkout [s, MB]."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    environment |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    began = time.monotonic()
    process = subprocess.Popen(
        [sys.executable, "-m", module, *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        cwd=checkout,  # first among the places of modules
        env={**environment, "PYTHONPATH": str(checkout), "PYTHONPYCACHEPREFIX": str(cache / checkout.name)},
    )
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode not in (0, 1):
        raise subprocess.CalledProcessError(process.returncode, process.args)
    cpu = usage.ru_utime + usage.ru_stime
    return {"cpu": cpu, "wall": time.monotonic() - began, "megabytes": usage.ru_maxrss / 1024}


def commands(data: Path, checkouts: dict[str, Path]) -> None:
    """Whole commands of one checkout after the other, on the real logs and on a simulated one."""
    before, cases = record.load(), []
    with tempfile.TemporaryDirectory() as folder:
        for seconds in (15, 30):
            in_own_process("log", path=str(Path(folder) / f"{seconds}.csv"), seconds=seconds, width=TURNS)
        for checkout in checkouts.values():
            command_run(
                checkout, Path(folder) / "compiled", ("-q", "excite", "regressors", "constraints"), "compileall"
            )
        for name, robot, log, other, options in COMMANDS:
            path, unseen = (
                next(at / file for at in (data, Path(folder)) if (at / file).exists()) for file in (log, other)
            )
            model = str(data / robot) if robot.endswith(".urdf") else robot
            runs: dict[str, list[dict[str, dict[str, float]]]] = {code: [] for code in checkouts}
            errors = {}
            for code in [*checkouts] * COMMAND_RUNS:
                out = Path(folder) / f"{code} {len(cases)}"
                quiet = (*options, "--figures", "none")
                identify = ("identify", model, str(path), *quiet, "--out", str(out), "--force")
                at = checkouts[code], Path(folder) / "compiled"
                identified = command_run(*at, identify)
                verified = command_run(*at, ("verify", str(out), str(unseen), *quiet))
                runs[code].append({"identify": identified, "verify": verified})
                errors[code] = json.loads(next(out.glob("verification*.json")).read_text())["relative_error"]
            rows = sum(1 for _ in path.open()) - 1
            cases += [{"log": name, "rows": rows, "code": c, "runs": runs[c], "error": errors[c]} for c in checkouts]
    lines = []
    for case in cases:
        timed = [(what, key) for what, key in (("identify", "cpu"), ("identify", "wall"), ("identify", "megabytes"),
                                               ("verify", "cpu"), ("verify", "wall"))]  # fmt: skip
        each = [spread([run[what][key] for run in case["runs"]], 0 if key == "megabytes" else 2) for what, key in timed]
        lines.append([case["log"], case["rows"], case["code"], *each, f"{100 * case['error']:.3g} %"])
    text = record.table(COMMAND_HEAD, lines)
    record.save("command_speed", before, {"commands": cases}, text, COMMAND_LIMITATIONS, folder=HERE)


if __name__ == "__main__":
    if len(sys.argv) > 1 and Path(sys.argv[1]).is_dir():
        others = {"before": Path(sys.argv[2]).resolve()} if len(sys.argv) > 2 else {}
        commands(Path(sys.argv[1]).resolve(), {**others, "now": HERE.parents[1]})
    elif len(sys.argv) > 1:
        wanted = json.loads(sys.argv[1])
        print(json.dumps(MODES[wanted.pop("mode")](**wanted)))
    else:
        main()
