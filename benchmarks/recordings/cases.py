"""The table of cases: command lines of ``excite``, each of which writes to a folder that has the case's name.

A word of a command line that begins with the name of an earlier case reads that case's folder: those are what it needs.
Words that begin with ``inputs/`` are files of this folder.
"""

from __future__ import annotations

import fnmatch
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field

_DESIGN = "design --executor serial --starts 1 --seed 3"
_WITHIN = "--acceleration-limit 6"  # arm.urdf states no accelerations

DESIGNS = {
    # families, criteria, bases
    "fourier": "irp6 --starts 2",
    "quintic": "irp6 --trajectory fourier-quintic --criterion frobenius --base pivoted",
    "cosine": "panda --no-friction --trajectory cosine --base orthonormal --criterion sigma-min",
    "bspline": "ur10e --trajectory bspline --intervals 12 --order 5 --criterion logdet --jerk-limit 60",
    "waypoints": "irp6 --trajectory waypoints --intervals 5 --criterion trace",
    "sines": "irp6 --trajectory sines --harmonics 4",
    "pivoted": "panda --no-friction --base pivoted --criterion trace",
    "frobenius-orthonormal": "irp6 --base orthonormal --criterion frobenius --harmonics 4",
    "bspline-short": "irp6 --trajectory bspline --intervals 10 --order 4 --period 6 --rate 50",
    # solvers, executors
    "ipopt": "irp6 --solver ipopt --harmonics 4",
    "ipopt-trace": "irp6 --solver ipopt --criterion trace --trajectory bspline --intervals 10",
    "processes": "irp6 --executor process --workers 2 --starts 3 --harmonics 4",
    # models
    "energy": "irp6 --model energy",
    "energy-long": "irp6 --model energy --window long --criterion sigma-min",
    "energy-window": "irp6 --model energy --window-length 0.05 --trajectory waypoints --intervals 5 --joints 2,3",
    "load": "irp6 --model load --period 6.4",
    "load-torques": "irp6 --model load --period 6.4 --equations nx,ny,nz --sensor-xyz 0,0,0.1 --sensor-rpy 0,0.2,0",
    "load-integral": "irp6 --model load-integral --period 6.4 --harmonics 4",
    "load-integral-long": "irp6 --model load-integral --window long --period 6.4 --trajectory cosine",
    "equations": "irp6 --equations q1 --harmonics 4",
    "columns": "ur10e --joint-rotors --offset --harmonics 6 --starts 1",
    "plain": "irp6 --no-rotor --no-friction --criterion logdet",
    # partial motions
    "drives": "irp6 --model energy --drives 2",
    "joints": "panda --joints 4,6 --no-friction",
    "require": "irp6 --require X5,F3c --criterion logdet",
    "begin": "irp6 --begin design-fourier --trajectory bspline --intervals 12 --starts 2",
    "begin-bent": "irp6 --begin design-fourier --trajectory waypoints --intervals 5",
    "shapes": "irp6 --start cosine,quintic,sines --starts 2",
    # limits
    "limits": "irp6 --position-limit=-1:1,-0.5:0.5,-0.6:0.4,-1:1,-2:2 --velocity-limit 0.8 --acceleration-limit 1.5"
    " --jerk-limit 8",
    "limits-bent": "irp6 --trajectory sines --harmonics 3 --velocity-limit 0.8 --jerk-limit 8 --criterion logdet",
    "torque": "panda --no-friction --torque-margin 0.5 --harmonics 4",
    "tool": "panda --no-friction --tool-box=-0.6:0.6,-0.6:0.6,0.1: --tool-speed 1.2 --tool-point 0,0,0.1 --harmonics 4",
    "torque-bent": "irp6 --trajectory waypoints --intervals 5 --torque-margin 0.3 --tool-box=:,:,0.3: --tool-speed 1",
    "sines-bent": "irp6 --trajectory sines --harmonics 3 --torque-margin 0.3 --tool-speed 1",
    "torque-load": "irp6 --model load --period 6.4 --torque-margin 0.3 --harmonics 4",
    "world": f"inputs/arm.urdf {_WITHIN} --world inputs/world.yaml",
    "world-bent": f"inputs/arm.urdf {_WITHIN} --world inputs/world.yaml --trajectory waypoints --intervals 6"
    " --no-friction",
    # ways and rehearsals
    "home": "irp6 --home 0,0.2,-0.2,0,0 --speed 0.1,0.5 --settle 0.5",
    "via": "irp6 --home 0.5,0.2,-0.2,0.1,0 --via 0.2,0.1,-0.1,0,0 --via 0,0,0,0,0 --torque-margin 0.2 --harmonics 4",
    "home-robot": "inputs/planar.yaml --home robot --no-friction --harmonics 3",
    "home-world": f"inputs/arm.urdf {_WITHIN} --world inputs/world.yaml --home 0.3,-1.2,0.5,0 --harmonics 5",
    # noise and prior knowledge
    "weighted": "irp6 --noise 0.5,2,1 --weighted",
    "prior": "irp6 --noise 0.5,2,1 --weighted --prior 0.2 --scale prior --criterion sigma-min",
    "prior-file": "irp6 --prior inputs/prior.yaml --scale value --criterion trace --noise 2",
    "prior-bent": "irp6 --prior 0.3 --noise 2 --trajectory sines --harmonics 3 --criterion logdet --base pivoted",
    # files
    "curves": "irp6 --friction-curves inputs/friction.yaml --torque-margin 0.2 --harmonics 4",
    "urdf": f"inputs/arm.urdf {_WITHIN} --base column --tip hand --base pivoted --period 12",
}

REFUSED = {
    "harmonics": "panda --no-friction --harmonics 1",
    "require": "irp6 --drives 1 --require X5",
    "samples": "irp6 --period 9.999",
    "rows": "irp6 --equations q7",
    "contradiction": "panda --tool-box=2:3,2:3,2:3",
    "solver": "irp6 --solver ipopt --trajectory sines",
}

ROBOTS = {
    "all": "",
    "irp6": "irp6 --json",
    "panda": "panda --no-friction --json",
    "joints": "ur10e --joints 2,3 --no-rotor --json",
    "urdf": "inputs/arm.urdf --base base --tip tool --json",
    "planar": "inputs/planar.yaml",
    "capsules": "inputs/arm.urdf --capsules",
}

PLANS = {
    "irp6": "irp6",
    "differential": "irp6 --model differential --no-rotor",
    "one": "irp6 --at-once 1",
    "panda": "panda --no-friction --at-once 3 --joints 1,2,3,4",
    "curves": "irp6 --friction-curves inputs/friction.yaml",
}

COMPARISONS = {
    "families": "design-fourier design-quintic design-sines design-waypoints",
    "energy": "design-fourier design-limits --model energy --window long",
    "prior": "design-prior design-weighted design-fourier",
    "load": "design-load design-load-integral --model load",
}

_MEASURED = "--encoder 4000 --torque-noise 1"
_LOAD = "--load 1.76,0,0,0.16,0.02,0,0,0.02,0,0.001 --wrench-noise 0.5,0.05 --position-noise 1e-5"

SIMULATIONS = {
    "clean": "design-fourier --rate 500",
    "run": f"design-fourier --rate 500 {_MEASURED} --seed 1 --periods 2",
    "other": f"design-fourier --rate 500 {_MEASURED} --seed 2 --model-error 0.1",
    "pd": "design-fourier --rate 500 --controller pd --bandwidth 8 --breakaway auto --position-noise 1e-5"
    " --velocity-noise 1e-3 --torque-noise 0.5 --seed 3",
    "curves": "design-fourier --rate 500 --friction inputs/friction.yaml --temperature 35 --torque-noise 0.5 --seed 4",
    "sticking": "design-fourier --rate 500 --breakaway 1e-4 --torque-noise 0.2 --no-torque-limits",
    "ways": "design-home --rate 400 --torque-noise 0.5",
    "no-ways": "design-home --rate 400 --no-ways --encoder 2000",
    "rehearsal": "design-home --rate 200 --trajectory design-home/trajectory-0.5.csv",
    "load": f"design-load --rate 500 {_LOAD} --seed 5",
    "load-other": "design-load --rate 500 --load inputs/load.yaml --wrench-rate 200 --wrench-noise 0.2,0.02 --seed 6",
    "energy": "design-drives --rate 500 --torque-noise 0.5 --velocity-noise 1e-3 --seed 7",
    "drive": "design-drives --rate 500 --friction inputs/friction.yaml --temperature 35 --torque-noise 0.5 --seed 9",
    "masses": "design-curves --rate 500 --friction inputs/friction.yaml --torque-noise 0.5 --seed 8",
    "plan": "friction-plan/z2.csv --controller pd --bandwidth 10 --rate 500 --torque-noise 0.5 --temperature 25"
    " --friction inputs/friction.yaml",
    "plan-warm": "friction-plan/z2.csv --controller pd --bandwidth 10 --rate 500 --torque-noise 0.5 --temperature 42"
    " --friction inputs/friction.yaml --seed 1",
    "ramps": "friction-plan/z2.stiction.csv --rate 500 --friction inputs/friction.yaml --torque-noise 0.2"
    " --catch 0.004",
    "arm": "design-urdf --rate 500 --torque-noise 0.1 --position-noise 1e-5",
}

_RUN = "irp6 simulate-run/run.csv --design design-fourier"

IDENTIFICATIONS = {
    # estimators
    "weighted": f"{_RUN}",
    "least-squares": f"{_RUN} --estimator least-squares --covariance white",
    "huber": f"{_RUN} --estimator huber --covariance robust",
    "recursive": f"{_RUN} --estimator recursive --every 5",
    "instrumental": f"{_RUN} --estimator instrumental",
    "physical": f"{_RUN} --estimator physical --every 5",
    "pulled": f"{_RUN} --estimator physical --described-within 0.3 --every 10",
    # signals
    "cutoff": f"{_RUN} --signals butterworth --cutoff 8",
    "differences": f"{_RUN} --signals differences --low-pass 5",
    "fourier": f"{_RUN} --signals fourier --harmonics 5 --period 10",
    "savitzky-golay": f"{_RUN} --signals savitzky-golay",
    "spline": "irp6 simulate-other/run.csv --design design-fourier --signals spline --every 2",
    "measured-velocity": "irp6 simulate-pd/run.csv --design design-fourier --measured-velocity --breakaway 1e-5",
    "average": f"{_RUN} --average",
    # models
    "energy": "irp6 simulate-energy/run.csv --design design-drives --measured-velocity",
    "energy-long": "irp6 simulate-run/run.csv --model energy --window long",
    "load": "irp6 simulate-load/run.wrench.csv --design design-load",
    "load-integral": "irp6 simulate-load/run.wrench.csv --model load-integral --window-length 0.02"
    " --equations nx,ny,nz",
    "load-integral-long": "irp6 simulate-load-other/run.wrench.csv --model load-integral --window long",
    "no-rotor": "irp6 simulate-clean/run.csv --no-rotor --offset --sign-width 0",
    # logs
    "two": "irp6 simulate-run/run.csv simulate-other/run.csv --rows all --sign-width 0.02",
    "rows": f"{_RUN} --rows 600:4200 --equations q2,q3",
    "mapping": "irp6 simulate-other/run.csv --mapping inputs/mapping.yaml --joints 1,2,3 --drop nan",
    "ways": "irp6 simulate-ways/run.csv --design design-home",
    "repeated": "irp6 simulate-drive/run.csv --drives 2 --repeat 3 --every 10 --seed 2 --estimator least-squares",
    "arm": "inputs/arm.urdf simulate-arm/run.csv --design design-urdf",
    # friction that is known
    "curves": "irp6 simulate-curves/run.csv --friction-curves inputs/friction.yaml --temperature 35",
    "masses": "irp6 simulate-masses/run.csv --design design-curves",
    "fitted": "irp6 simulate-drive/run.csv --drives 2 --friction-curves friction-fit-warm/friction.yaml",
    "shortened": "irp6 simulate-curves/run.csv --friction-curves friction-fit-short/friction.yaml --every 2",
}

VERIFICATIONS = {
    "weighted": "identify-weighted simulate-other/run.csv",
    "strict": "identify-weighted simulate-other/run.csv --torque-tolerance 1 --motion-tolerance 1 --horizon 1",
    "training": "identify-huber simulate-run/run.csv --training-too --signals spline --rows 700:3000",
    "other-friction": "identify-weighted simulate-curves/run.csv",
    "curves": "identify-curves simulate-curves/run.csv --temperature 30 --training-too",
    "load": "identify-load simulate-load-other/run.wrench.csv",
    "energy": "identify-energy-long simulate-clean/run.csv simulate-other/run.csv",
    "refused": "identify-weighted simulate-run/run.csv",
}

_SHORT = "--speeds 10,40,100 --longest 0.6 --warm-up 0 --rate 200"

FRICTION_PLANS = {
    "": f"irp6 --drives 2 {_SHORT} --breakaways 2 --creeping 2 --ramping 2",
    "pose": f"irp6 --drives 1 {_SHORT} --breakaways 1 --pose 0,0.1,-0.1,0,0 --stroke 0.4 --repeats 2 --torque-ramp 50",
    "joints": f"panda --joints 4,6 {_SHORT} --breakaways 0 --velocity-limit 1 --jerk-limit 50",
    "world": f"inputs/arm.urdf {_WITHIN} --joints 1,2 {_SHORT} --breakaways 0 --world inputs/world.yaml",
    "warm": f"irp6 --drives 3 {_SHORT} --warm-up 4 --breakaways 1 --creep 0.2 --balanced --pose 0,0,0,0,0 --pause 0.2",
}

FRICTION_FITS = {
    "": "irp6 simulate-plan/run.csv simulate-ramps/run.csv --plan friction-plan",
    "warm": "irp6 simulate-plan/run.csv simulate-plan-warm/run.csv --plan friction-plan --temperature linear",
    "alone": "irp6 simulate-plan/run.csv --drives z2 --window 0.25 --tolerance 0.05",
    "symmetric": "irp6 simulate-plan/run.csv --drives 2 --gravity symmetric --model coulomb-viscous --stiction report",
    "none": "irp6 simulate-plan/run.csv --plan friction-plan --gravity none --model stribeck --exponent 1 --load none",
    "table": "irp6 simulate-plan/run.csv --plan friction-plan --model table --criterion aicc --speed constant",
    "parameters": "irp6 simulate-plan/run.csv --drives 2 --parameters identify-weighted --gravity model",
    "short": "irp6 simulate-curves/run.csv --speed averaged --temperature none --model coulomb-viscous",
}


@dataclass(frozen=True)
class Case:
    """One command.

    Parameters
    ----------
    name : str
        Also that of the folder that it writes to.
    arguments : tuple of str
        Of ``excite``.
    needs : tuple of str
        Cases whose folders it reads.
    prints : {"nothing", "json", "yaml", "text"}
        Of what is printed, what is recorded: as it is, or of a text its numbers.
    """

    name: str
    arguments: tuple[str, ...]
    needs: tuple[str, ...] = ()
    prints: str = field(default="nothing")


def _case(name: str, line: str, known: Mapping[str, Case], prints: str = "nothing") -> Case:
    arguments = tuple(shlex.split(line))
    folders = (argument.split("/")[0] for argument in arguments)
    return Case(name, arguments, tuple(dict.fromkeys(place for place in folders if place in known)), prints)


def _printed(line: str) -> str:
    return "yaml" if "--capsules" in line else "json" if "--json" in line else "text"


def _lines() -> list[tuple[str, str, str]]:
    """Name, command line, and what is recorded of what it prints; in an order in which needs come first."""
    out, log = "nothing", "run.csv"
    designs = [(f"design-{k}", f"{_DESIGN} {line} --out design-{k}", out) for k, line in DESIGNS.items()]
    task = [("design-task", "design irp6 --task inputs/task.yaml --period 9 --out design-task", out)]
    refused = [(f"refused-{k}", f"{_DESIGN} {line} --out refused-{k}", out) for k, line in REFUSED.items()]
    robots = [(f"robots-{k}", f"robots {line}", _printed(line)) for k, line in ROBOTS.items()]
    plans = [(f"plan-{k}", f"plan {line} --json", "json") for k, line in PLANS.items()]
    compared = [(f"compare-{k}", f"compare {line} --json", "json") for k, line in COMPARISONS.items()]
    ways = [(f"friction-plan{_dash(k)}", f"friction plan {line}", out) for k, line in FRICTION_PLANS.items()]
    logs = [(f"simulate-{k}", f"simulate {v} --out simulate-{k}/{log}", out) for k, v in SIMULATIONS.items()]
    fits = [(f"friction-fit{_dash(k)}", f"friction fit {line}", out) for k, line in FRICTION_FITS.items()]
    found = [(f"identify-{k}", f"identify {line}", out) for k, line in IDENTIFICATIONS.items()]
    judged = [(f"verify-{k}", f"verify {line}", out) for k, line in VERIFICATIONS.items()]
    into = [(name, f"{line} --out {name}", kind) for name, line, kind in (*found, *fits, *judged)]
    plotted = [(name, f"{line} --out {name}", kind) for name, line, kind in ways]
    return [*robots, *plans, *designs, *task, *refused, *compared, *plotted, *logs, *_in_order(into)]


def _dash(name: str) -> str:
    return f"-{name}" if name else ""


def _in_order(lines: list[tuple[str, str, str]]) -> list[tuple[str, str, str]]:
    """Identifications without fitted friction, fits, the other identifications, verifications."""

    def rank(line: tuple[str, str, str]) -> int:
        name, words, _ = line
        return 3 if name.startswith("verify") else 1 if name.startswith("friction") else 2 * ("friction-fit" in words)

    return sorted(lines, key=rank)


def cases() -> dict[str, Case]:
    """All cases by name, each after those that it needs."""
    found: dict[str, Case] = {}
    for name, line, prints in _lines():
        found[name] = _case(name, line, found, prints)
    return found


def chosen(pattern: str) -> dict[str, Case]:
    """Cases whose names match a pattern such as ``identify-*``, and those that they need."""
    known = cases()
    wanted = set(fnmatch.filter(known, pattern))
    for name in reversed(known):
        if name in wanted:
            wanted.update(known[name].needs)
    return {name: case for name, case in known.items() if name in wanted}
