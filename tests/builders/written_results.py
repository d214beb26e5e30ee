"""Commands that write results, with their computations done once before: what they do to the disk is all that is left.

A command of its own is one more line in `COMMANDS`.
"""

from __future__ import annotations

import hashlib
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from commands import files_below

import excite
from excite import (  # before they are replaced
    design_trajectory,
    guess_mapping,
    identify,
    plan_friction,
    simulate,
    verify,
)
from excite.cli.main import main
from excite.design.design_json import load_design
from excite.design.friction_runs.friction_plan import load_friction_plan
from excite.design.problem_identity import ProblemIdentity
from excite.design.start_results import write_start
from excite.design.starts import KeptStarts
from excite.friction.constant_speed_windows import FitSettings
from excite.friction.friction_fit import Characteristic, FrictionFit
from excite.friction.points import Point
from excite.identification.result_json import load_result
from excite.logs.log_reading import read_log, read_sidecar
from excite.logs.mapping import read_mapping
from excite.payload.held_body import Frame
from excite.payload.known_gains import read_gains
from excite.payload.load_estimate import LoadEstimate
from excite.storage.atomic import Destination, read_json
from excite.storage.commit import settle
from excite.storage.result_folder import settle_files
from excite.study.time_study import TimeCourse, TimeStudy
from excite.tasks.friction_file import read_friction
from excite.views import design_view
from regressors.errors import InputError
from regressors.readers.urdf import parse_urdf
from regressors.robot.friction.curve import CoulombViscous
from regressors.robot.friction.curves import FrictionCurves

VERSIONS = ("old", "new")
Patch = pytest.MonkeyPatch


@dataclass(frozen=True)
class Command:
    """A command, what it computes, and what reads the files that it writes.

    Parameters
    ----------
    lines : tuple of str
        The command line of each version, or of both; ``OUT`` stands for what is written.
    stub : callable
        Puts a version's results in place of the computation.
    read : callable
        Reads what was written; raises InputError if there is none.
    out : str
        What is written, below the folder.
    forced : bool
        True if replacing needs ``--force``.
    """

    lines: tuple[str, ...]
    stub: Callable[[Patch, str], None]
    read: Callable[[Path], object]
    out: str = "out"
    forced: bool = True

    def run(self, folder: Path, version: str, patch: Patch, *, force: bool) -> int:
        """Exit status of a version's command, which writes below a folder."""
        self.stub(patch, version)
        patch.setattr("excite.cli.summary._print_text", lambda _, drawn, *__: drawn())
        line = self.lines[VERSIONS.index(version) % len(self.lines)]
        words = line.replace("OUT", str(folder / self.out)).split()
        patch.setattr(sys, "argv", ["excite", *words, *(["--force"] if force and self.forced else [])])
        with pytest.raises(SystemExit) as ended:
            main()
        return int(ended.value.code or 0)


def hashes(folder: Path) -> dict[str, str]:
    """Hash of every file below a folder."""
    files = {name: folder / name for name in sorted(files_below(folder)) if (folder / name).is_file()}
    return {name: hashlib.sha256(path.read_bytes()).hexdigest() for name, path in files.items()}


@dataclass
class Picture:
    """A figure that costs nothing to draw, and its canvas."""

    text: str
    dpi: float = 100.0
    axes: tuple[()] = ()

    def get_layout_engine(self) -> None:
        """It has no panels to lay out."""

    def get_children(self) -> list[Any]:
        """It has no parts."""
        return []

    def savefig(self, stream: Any, **_: object) -> None:
        """Write the text."""
        stream.write(self.text.encode())

    print_png = savefig


def _stub(
    place: str, made: Callable[[str], Any], *pictures: str, also: Mapping[str, Any] = MappingProxyType({})
) -> Callable[[Patch, str], None]:
    """Puts what was made of a version in place of the call that makes it, and pictures in place of figures."""

    def stub(patch: Patch, version: str) -> None:
        for each in VERSIONS:
            made(each)  # before any part of it is replaced
        replaced = {place: made(version), **also}
        for name, value in replaced.items():
            patch.setattr(name, lambda *_, value=value, **__: value)
        if pictures:
            patch.setattr("excite.views.figures.FigureCanvasAgg", lambda picture: picture)
        for name in pictures:
            patch.setattr(f"excite.views.{name}", lambda *_, name=name: Picture(f"{version} {name.split('.')[-1]}"))

    return stub


@cache
def design(version: str) -> excite.Design:
    """A design of the version; they differ in their rehearsals and their number of starts."""
    speed = {"old": (0.5,), "new": (0.25, 0.75)}[version]
    return design_trajectory(
        "irp6",
        trajectory=excite.TrajectoryChoice(harmonics=3, period=2.0),
        search=excite.Search(starts=1 if version == "new" else 2, seed=VERSIONS.index(version), executor="serial"),
        output=excite.Output(rate=20.0, speed=speed),
    )


@cache
def simulation(version: str) -> Any:
    """A run of the design."""
    return simulate(design("old"), rate=200.0, torque_noise=(0.1,), seed=VERSIONS.index(version))


@cache
def result(version: str) -> excite.Identification:
    """A result from that run."""
    return identify("irp6", [simulation(version)], choose=False, estimator="weighted")


@cache
def verification(version: str) -> Any:
    """A verification on another run."""
    return verify(result(version), simulation("old"), training_too=True)


@cache
def plan(version: str) -> Any:
    """A friction plan; the new one has other trajectories."""
    schedule = excite.Schedule(percent=(20.0, 100.0), warm_up=0, breakaways=0, rate=50.0)
    return plan_friction("irp6", schedule, drives=["z3"] if version == "old" else ["z5"], torque_ramp=None)


_FIGURES = design_view._DRAWN  # before any of them is left out


def _stub_design(patch: Patch, version: str) -> None:
    for each in VERSIONS:
        design(each)  # before its parts are replaced
    made = design(version)
    identity = ProblemIdentity({"version": version}, run=version)
    problem = SimpleNamespace(notes=(), task=made.task, target=made.target, identity=identity)

    def solve(_: object, __: object, kept: KeptStarts, ___: object, **____: object) -> excite.Design:
        for start in made.starts:
            write_start(kept.folder, start, identity.origin)
        return made

    patch.setattr("excite.cli.design_run.formulate", lambda *_: problem)
    patch.setattr("excite.cli.design_run.solve", solve)
    names = ("motion", "phase", "spectrum", "workspace") if version == "old" else ("motion", "phase", "workspace")
    shown = tuple(each for each in _FIGURES if each.ending in names)
    patch.setattr("excite.views.design_view._DRAWN", shown)
    patch.setattr("excite.views.figures.FigureCanvasAgg", lambda picture: picture)
    for each in shown:
        name = each.function.split(".")[-1]
        patch.setattr(f"excite.views.{each.function}", lambda *_, name=name: Picture(f"{version} {name}"))


@cache
def friction_fit(version: str) -> FrictionFit:
    """A fit of one drive, of other points in the new version; its curves are given, not fitted."""
    points = tuple(Point(v, v + VERSIONS.index(version), 0.1, 0.0, 1.0, 0) for v in (-1.0, 1.0))
    drive = Characteristic("z1", "Nm", "none", points, (), None, (), {}, (), ())
    return FrictionFit("irp6", "", (), FitSettings(), (drive,), None, {})


def _stub_fit(patch: Patch, version: str) -> None:
    curves = FrictionCurves({"z1": CoulombViscous(1.0 + VERSIONS.index(version), 1.0, 0.0)})
    patch.setattr(FrictionFit, "curves", curves)
    _stub("excite.fit_friction", friction_fit, "friction_plots.friction_figure")(patch, version)


@cache
def study(version: str) -> TimeStudy:
    """A study of one parameter."""
    one = np.ones((2, 1)) + VERSIONS.index(version)
    course = TimeCourse("run", ("X",), ("kg",), np.arange(2.0), one, one, 2.6, one[:, 0], one[0], "truth")
    return TimeStudy("irp6", "", (course,), 0.05)


@cache
def payload(version: str) -> Any:
    """An identified payload; the new one is heavier."""
    robot = excite.load_robot("panda")
    mass = 1.0 + VERSIONS.index(version)
    phi = np.array([mass, 0.0, 0.0, 0.1 * mass, 0.02 * mass, 0.0, 0.0, 0.02 * mass, 0.0, 0.01 * mass])
    none = np.zeros((0, 0))
    estimate = LoadEstimate(phi, 1e-6 * np.eye(10), 0.0 * np.eye(10), none[0:0].ravel(), none, phi[:0], 9, phi[:0], 9.0)
    frame = Frame("flange", np.eye(3), np.zeros(3))
    return excite.PayloadResult(robot, frame, estimate, "wrench", None)


def payload_motion(version: str) -> excite.PayloadMotion:
    """The design as the motion of a payload."""
    return excite.PayloadMotion(design(version), np.zeros(5), None, ())


def gains(version: str) -> excite.CalibratedGains:
    """Gains of one drive."""
    known = excite.KnownGains(("z1",), np.array([1.0 + VERSIONS.index(version)]), np.eye(1), "")
    return excite.CalibratedGains("irp6", known, 1.0, 1.0, 3.0, ())


@cache
def guess(version: str) -> Any:
    """A guess of a log; they differ in their questions."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.csv"
        lines = [f"{k / 50},{k % 9},{k % 4}" for k in range(60 + VERSIONS.index(version))]
        path.write_text("\n".join(["t,q1,tau1[Nm]" if version == "old" else "t,q1,tau1", *lines]), encoding="utf-8")
        return guess_mapping(path)


def _read_page(path: Path) -> str:
    settle_files(path)
    if not path.exists():
        raise InputError(f"there is no {path}")
    return path.read_text(encoding="utf-8")


def _settled(file: str) -> Callable[[Path], object]:
    def read(folder: Path) -> object:
        settle(Destination(folder))
        return read_json(folder / file)

    return read


def _read_export(path: Path) -> object:
    return read_mapping(path.with_name(f"{path.name}.mapping.yaml")), _read_page(path)


_RESULT = ("identification_plots.torques_figure", "identification_plots.residuals_figure",
           "parameters_plot.parameters_figure")  # fmt: skip
_VERIFICATION = ("verification_plots.predicted_torques_figure", "verification_plots.simulated_motion_figure")
_OLD, _NEW = "design irp6 --out OUT --starts 2 --speed 0.5", "design irp6 --out OUT --starts 1 --speed 0.25,0.75"
_MOTION = {"excite.cli.simulate_run.motion_source": SimpleNamespace(task=excite.Task("irp6"))}
_FOLDER = {"excite.load_result": SimpleNamespace(folder=None)}
COMMANDS = {
    "design": Command((_OLD, _NEW), _stub_design, load_design),
    "design, other figures": Command((_OLD, f"{_NEW} --figures pdf,svg"), _stub_design, load_design),
    "design, no figures": Command((_OLD, f"{_NEW} --figures none"), _stub_design, load_design),
    "simulate": Command(
        ("simulate designs/any --out OUT",), _stub("excite.simulate", simulation, also=_MOTION),
        lambda path: (read_log(path), read_sidecar(path)), out="logs/run.csv",
    ),
    "identify": Command(
        ("identify irp6 run.csv --out OUT",), _stub("excite.cli.identify_run._identified", result, *_RESULT),
        load_result,
    ),
    "verify": Command(
        ("verify any run.csv --out OUT",), _stub("excite.verify", verification, *_VERIFICATION, also=_FOLDER),
        _settled("verification-run.json"), forced=False,
    ),
    "friction plan": Command(
        ("friction plan irp6 --out OUT",), _stub("excite.plan_friction", plan, "friction_plots.friction_plan_figure"),
        load_friction_plan,
    ),
    "friction fit": Command(
        ("friction fit irp6 run.csv --out OUT",), _stub_fit,
        lambda folder: (read_friction(folder / "friction.yaml"), _settled("fit.json")(folder)),
    ),
    "export": Command(
        ("export designs/any --format ros2-yaml --out OUT",), _stub("excite.load_design", design), _read_export,
        out="play/goal.yaml",
    ),
    "export model": Command(
        ("export results/any --format urdf --out OUT",),
        _stub("excite.load_result", result, also={"excite.cli.exchange_run._holds_result": True}),
        lambda path: parse_urdf(_read_page(path).encode()).sha256(), out="models/robot.urdf",
    ),
    "payload design": Command(
        ("payload design irp6 --out OUT",), _stub("excite.design_payload_motion", payload_motion), load_design
    ),
    "payload gains": Command(
        ("payload gains irp6 --without a.csv --with b.csv --mass 1 --out OUT",), _stub("excite.calibrate_gains", gains),
        read_gains, out="gains/of.yaml",
    ),
    "payload identify": Command(
        ("payload identify panda --wrench run.csv --out OUT",), _stub("excite.identify_payload", payload),
        _settled("payload.json"),
    ),
    "logs": Command(
        ("logs run.csv --write-mapping OUT",), _stub("excite.guess_mapping", guess), read_mapping, out="maps/run.yaml"
    ),
    "report": Command(
        ("report designs/any --out OUT",), _stub("excite.views.write_report.report_text", "<html>{}</html>".format),
        _read_page, out="pages/page.html",
    ),
    "study": Command(
        ("study irp6 run.csv --out OUT",),
        _stub("excite.study_over_time", study, "identification_plots.estimates_over_time_figure"),
        _settled("study.json"),
    ),
}  # fmt: skip
