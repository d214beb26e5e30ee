"""Calls of the public API with wrong and odd arguments: each must end in a result or in an `ExciteError`.

A case is a public callable with arguments that work, of which one or two are replaced: by values of other types, by
numbers of any size, or, where the right value is an array, by one that is spoiled in one place.
"""

from __future__ import annotations

import contextlib
import inspect
import io
import json
import os
import random
import signal
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from designed import short

import excite
from constraints.geometry import Part, World
from regressors.models.windows import Window
from regressors.robot.columns import Terms
from regressors.robot.friction.curve import CoulombViscous
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.shapes import Capsule

Arguments = Mapping[str, Any]
NOISY = excite.SimulationSettings(torque_noise=0.5)
PATIENCE = 0.1  # seconds of processor time after which a call that is at work is stopped
_STUCK = 120  # seconds after which a call waits for something


def plain_values() -> list[Any]:
    """Values of any type, most of them wrong for any argument."""
    numbers = [0, 1, -1, 3, 2**70, 0.0, -0.5, 0.05, 1e-300, 1e300, np.nan, np.inf, -np.inf, 1j, True, False]
    odd_numbers = [np.float64(1.5), np.int64(3), np.bool_(True), Decimal("1.5"), Fraction(1, 3), np.datetime64("2026")]
    texts = ["", "x", "auto", "all", "1", "\0", "\u00e9" * 300, b"x", Path("missing"), Path("/")]
    lists = [[], (), [1.0], [1.0, 2.0], (1.0,) * 6, ["1"], ["x", "x"], [None], [[1.0]], [np.nan], range(3), [1, "x"]]
    several = [{}, {"x": 1.0}, {1: "x"}, set(), {"x"}, iter([1.0]), slice(3)]
    arrays = [np.array(2.0), np.array([1.0, 2.0]), np.array([1j]), np.array(["x"]), np.zeros((2, 2)), np.zeros(0)]
    more = [np.full(3, np.nan), np.full(6, 1e300), np.array([None]), np.arange(3)]
    kinds = [None, object(), lambda *_: None, int, excite.Task, ValueError("x"), NotImplemented, ...]
    return [*numbers, *odd_numbers, *texts, *lists, *several, *arrays, *more, *kinds]


def spoiled(array: Any) -> list[Any]:
    """An array with one thing wrong."""
    one_nan, one_inf = array.astype(float), array.astype(float)
    if array.size:
        one_nan.flat[array.size // 2], one_inf.flat[-1] = np.nan, np.inf
    return [
        one_nan, one_inf, array[::-1], array + 0j, array.astype(object), array.astype(str), array.T, array[:-1],
        array[..., None], array.tolist(), np.repeat(array, 2, axis=0), np.zeros_like(array), 1e300 * array, array[:0],
    ]  # fmt: skip


class Api:
    """Public callables with arguments that work, in a folder of their own.

    Parameters
    ----------
    folder : Path
        Where results lie and are written.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.design = short()
        self.simulation = excite.simulate(self.design, noise=0.5, seed=1, rate=200.0)
        self.log = self.simulation.measured
        self.result = excite.identify(self.design.task, self.log, design=self.design, choose=False)
        self.objects = [*self._saved(), self.design, self.log, self.result, self.design.robot, self.design.task]

    def _saved(self) -> list[str]:
        self.design.save(self.folder / "design")
        self.simulation.save(self.folder / "run.csv")
        self.result.save(self.folder / "result")
        return [str(self.folder / name) for name in ("design", "run.csv", "result")]

    def values(self) -> dict[str, Arguments]:
        """Classes whose objects users make."""
        robot, q = self.design.robot, np.linspace(0.0, 1.0, 12).reshape(4, 3)
        time, joints = np.arange(4.0), ("a", "b", "c")
        motion = excite.TaskMotion("m", joints, q, q, q)
        window, curves = Window(), FrictionCurves({"1": CoulombViscous(1.0, 1.0)})
        families = {name: {"period": 4.0, "harmonics": 5} for name in ("Cosine", "Fourier", "FourierQuintic", "Sines")}
        parts = ("Installation", "LimitChoice", "ModelChoice", "Objective", "Output", "Search", "TrajectoryChoice")
        settings = ("FitSettings", "LogChoice", "Recipe", "Schedule", "SimulationSettings")
        return complete(
            {
                **families,
                **{name: defaults_of(name) for name in (*parts, *settings, "PrecisionTarget", "Tolerances")},
                "BSpline": {"period": 4.0, "intervals": 9},
                "Waypoints": {"period": 4.0, "intervals": 9},
                "Belief": {"name": "m1", "value": 1.0, "deviation": 0.1},
                "Collisions": {"world": World((Part("1", Capsule((0.0,) * 3, (0.1, 0.0, 0.0), 0.05)),), ())},
                "Column": {"name": "m1", "unit": "kg", "kind": "mass", "owner": 1},
                "DifferentialModel": {"robot": robot, "terms": Terms()},
                "EnergyModel": {"robot": robot, "window": window},
                "ImpactPulse": {"joint": "1", "time": 1.0, "torque": 5.0},
                "KnownGains": {"drives": ("1", "2"), "factor": np.ones(2), "covariance": np.eye(2), "origin": "here"},
                "LoadIntegralModel": {"robot": robot, "sensor": excite.Sensor(), "window": window},
                "LoadModel": {"robot": robot, "sensor": excite.Sensor()},
                "Log": {"source": "x", "sha256": "", "joints": joints, "time": time, "q": q, "dq": q, "effort": q,
                        "wrench": np.ones((4, 6)), "temperature": q, "numbers": np.arange(1, 5)},
                "NonlinearConstraint": {
                    "joints": 3, "expression": lambda q, dq, ddq: q, "lower": -np.ones(3), "upper": np.ones(3),
                    "scale": np.ones(3), "labels": joints, "units": ("rad",) * 3,
                },
                "Payload": {"phi": [1.0, 0.0, 0.0, 0.1, 0.02, 0.0, 0.0, 0.02, 0.0, 0.02]},
                "PayloadModel": {"robot": robot},
                "PlausibleTorqueLimit": {"uncertainty": 0.2, "friction": curves},
                "Robot": {field: getattr(robot, field) for field in robot.__dataclass_fields__},
                "Samples": {"time": time, "q": q, "dq": q, "ddq": q, "dddq": q},
                "Sensor": {"rotation": np.eye(3), "translation": np.zeros(3), "equations": ("fx", "nz")},
                "Task": {"robot": "irp6", "period": 4.0, "noise": 1.0, "gravity": (0.0, 0.0, -9.81), "friction": True,
                         "friction_curves": curves},
                "TaskMotion": {"name": "m", "joints": joints, "q": q, "dq": q, "ddq": q},
                "TaskTorques": {"share": 0.1, "motion": motion},
                "ToolBox": {"lower": (-1.0,) * 3, "upper": (1.0,) * 3},
                "ToolSpeed": {"speed": 1.0},
                "TorqueLimit": {"margin": 0.1, "friction": curves},
            }
        )  # fmt: skip

    def files(self) -> dict[str, Arguments]:
        """What reads files and small things."""
        run, design, robot = self.folder / "run.csv", self.folder / "design", self.design.robot
        (self.folder / "friction.yaml").write_text("drives:\n  '1': {coulomb: 1.0, viscous: 1.0}\n")
        (self.folder / "world.yaml").write_text("robot: []\nobjects: {}\n")
        calls: dict[str, Arguments] = {
            "load_robot": {"spec": "irp6"},
            "load_design": {"folder": design},
            "load_result": {"folder": self.folder / "result"},
            "load": {"path": design},
            "read_log": {"path": run, "only": (1, 90), "robot": robot},
            "read_mapping": {"path": self.folder / "friction.yaml"},
            "read_recording": {"path": run},
            "read_friction": {"path": self.folder / "friction.yaml"},
            "read_world": {"path": self.folder / "world.yaml"},
            "guess_mapping": {"path": run, "robot": robot},
            "measured_noise": {"result": self.result},
            "base_parameters": {"model": excite.DifferentialModel(robot)},
        }
        return complete(calls)

    def designs(self) -> dict[str, Arguments]:
        """What plans motions."""
        search, task = excite.Search(starts=1, executor="serial"), self.design.task
        return complete(
            {
                "design_trajectory": {
                    "robot_or_model": "irp6", "criterion": "condition", "search": search, "period": 4.0, "noise": 1.0,
                    "joints": None,
                },
                "design_for_precision": {"robot_or_model": task, "precision": 0.5},
                "next_motion": {"robot_or_model": task, "precision": 0.5, "of": "measured", "after": (self.result,)},
                "plan_campaign": {"robot_or_model": "irp6", "at_once": 1, "period": 4.0, "search": search},
                "design_payload_motion": {
                    "robot": "irp6", "box": 0.2, "sensor": "torque", "period": 4.0, "harmonics": 3, "starts": 1,
                },
                "plan_friction": {"robot": "irp6", "joints": ("1",), "torque_ramp": None},
                "run_sweep": {"cells": {"a": task}, "folder": self.folder / "o", "executor": "serial"},
                "compare": {"designs": [self.design]},
                "bound": {"design": self.design, "criteria": ("condition",), "rounds": 1},
            }
        )  # fmt: skip

    def measurements(self) -> dict[str, Arguments]:
        """What computes with logs and results."""
        log, design, result, task = self.log, self.design, self.result, self.design.task
        calls: dict[str, Arguments] = {
            "simulate": {"source": design, "noise": 1.0, "rate": 200.0},
            "identify": {"model": task, "logs": log, "design": design, "estimator": "weighted", "choose": False},
            "verify": {"result": result, "log": log, "horizon": 0.5, "training_too": True},
            "identify_payload": {"robot": "irp6", "loaded": log, "without": log},
            "calibrate_gains": {"robot": "irp6", "loaded": log, "without": log, "mass": 1.0},
            "fit_friction": {"robot": "irp6", "logs": log},
            "predict_accuracy": {"design": design, "settings": NOISY, "count": 4},
            "sample_posterior": {"result": result, "samples": 3, "prior": 0.3},
            "study_over_time": {"model": task, "logs": (log,), "points": 3, "executor": "serial"},
        }
        return complete(calls)

    def outputs(self) -> dict[str, Arguments]:
        """What draws and writes."""
        out = self.folder / "o"
        out.mkdir(exist_ok=True)
        model = {"result": self.result, "format": "csv", "out": out / "m.csv", "replace": True}
        calls: dict[str, Arguments] = {
            "draw": {"result": self.design},
            "write_figures": {"design": self.design, "folder": out},
            "write_report": {"paths_or_objects": self.design, "out": out / "r.html", "replace": True},
            "export_model": model,
            "export_ensemble": {**model, "format": "npz", "out": out / "e", "samples": 3},
            "export_motion": {"design": self.design, "format": "npz", "out": out / "m.npz", "replace": True},
        }
        return complete(calls)


def complete(calls: Mapping[str, Arguments]) -> dict[str, Arguments]:
    """The same calls with the defaults of all other parameters, so that each of them may be changed."""
    return {name: {**_defaults(getattr(excite, name)), **given} for name, given in calls.items()}


def _defaults(function: Callable[..., Any]) -> dict[str, Any]:
    parameters = inspect.signature(function).parameters.values()
    known = [p for p in parameters if p.default is not p.empty and repr(p.default) != "<factory>"]
    return {p.name: p.default for p in known if p.name != "progress"}


def defaults_of(name: str) -> dict[str, Any]:
    """Arguments of a class that has a default for each."""
    made = getattr(excite, name)()
    return {parameter: getattr(made, parameter) for parameter in inspect.signature(getattr(excite, name)).parameters}


def cases(api: Api, calls: Mapping[str, Arguments], count: int, seed: int) -> Iterator[tuple[str, dict[str, Any]]]:
    """Calls by the name of what is called, with one or two arguments that are others than in the right call."""
    draw = random.Random(seed)
    names = sorted(calls)
    for k in range(count):
        name = names[k % len(names)]
        arguments = dict(calls[name])
        for changed in draw.sample(sorted(arguments), k=min(len(arguments), draw.choice((1, 1, 2)))):
            right = arguments[changed]
            values = spoiled(right) if isinstance(right, np.ndarray) and draw.random() < 0.6 else plain_values()
            arguments[changed] = draw.choice([*values, *api.objects] if draw.random() < 0.9 else api.objects)
        yield name, arguments


def problems(kind: str, count: int, seed: int) -> list[list[str]]:
    """Callable, problem and arguments of each call of a kind that ends as it must not, in this process's children."""
    with public_api() as api:
        ended = (
            [name, problem_of_child(name, arguments) or "", repr(arguments)[:500]]
            for name, arguments in cases(api, getattr(api, kind)(), count, seed)
        )
        return [call for call in ended if call[1]]


def problem(name: str, arguments: Arguments) -> str | None:
    """What must not be about the way in which a call ends; None where all is well."""
    silent = contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO())
    try:
        with warnings.catch_warnings(), silent[0], silent[1]:
            warnings.simplefilter("error")
            warnings.filterwarnings("ignore", category=DeprecationWarning)
            called(getattr(excite, name), arguments)
    except excite.ExciteError:
        return None
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        return f"{type(error).__name__}: {str(error)[:150]} ({Path(place.filename).name}:{place.lineno})"
    return None


def problem_of_child(name: str, arguments: Arguments) -> str | None:
    """The same of a call in a process of its own, which ends where the call is at work: it took its arguments."""
    read, write = os.pipe()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "os.fork", RuntimeWarning)  # JAX, where an earlier test has loaded it
        child = os.fork()
    if child == 0:
        with contextlib.suppress(BaseException):
            signal.signal(signal.SIGPROF, signal.SIG_DFL)
            signal.setitimer(signal.ITIMER_PROF, PATIENCE)
            signal.alarm(_STUCK)
            os.write(write, (problem(name, arguments) or "").encode())
            os._exit(0)
        os._exit(1)
    os.close(write)
    with os.fdopen(read, "rb") as pipe:
        found = pipe.read().decode()
    ended = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    return found or (None if ended in (0, -signal.SIGPROF) else f"the process ended with {ended}")


def called(function: Callable[..., Any], arguments: Arguments) -> Any:
    """What a function returns for arguments by name, of which some can be given by position only."""
    parameters = inspect.signature(function).parameters.values()
    first = [p.name for p in parameters if p.kind is p.POSITIONAL_ONLY and p.name in arguments]
    several = [p.name for p in parameters if p.kind is p.VAR_POSITIONAL]
    named = {name: value for name, value in arguments.items() if name not in (*first, *several)}
    return function(*(arguments[name] for name in first), **named)


@contextlib.contextmanager
def public_api() -> Iterator[Api]:
    """The public callables, in a temporary folder."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name, contextlib.chdir(name):
        yield Api(Path(name))


if __name__ == "__main__":  # KIND COUNT SEED: a process of its own, without the threads of what tests have loaded
    print(json.dumps(problems(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))))
