"""How often the fault of a spoilt log is named right, and how often a sound log is accused.

.venv/bin/python benchmarks/spoilt_logs/study.py [--seeds 2] [--robots NAMES] [--real FOLDER] [--choose]
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import record
from real_logs import real_logs
from spoilt import KINDS, ROBOTS, Spoilt, clean_log, spoilt

import excite
from excite.logs.log import Log
from regressors.errors import InputError

HERE = Path(__file__).resolve().parent
SHOWS = 1.2  # a fault shows where the residual of a joint is that many times the sound log's
WORDS = {  # of each kind, what its sentence says of the joints a and b
    "torques swapped": "torque columns of {a} and {b} are exchanged",
    "torques shifted": "torque columns are shifted",
    "torque sign": "torques of {a} have the opposite sign",
    "positions swapped": "position columns of {a} and {b} are exchanged",
    "position sign": "positions of {a} have the opposite sign",
    "torque gain": "torques of {a} are",
    "magnitudes": "magnitudes",
    "late": "all torques are",
    "channel late": "torques of {a} are",
    "zero": "zero of {a} is off",
    "clipped": "torques of {a} are cut off",
}


@dataclass(frozen=True)
class Outcome:
    """What was said of one log."""

    robot: str
    seed: int
    kind: str
    joints: tuple[str, ...]
    outcome: str  # named, one of two, wrong, not named, refused
    shows: bool
    said: str
    seconds: float


def errors(result: excite.Identification) -> np.ndarray:
    """Residual of each equation over its torque."""
    o = result.observations
    residual = o.y - result.estimate.predicted(o)
    return np.array(
        [
            np.linalg.norm(residual[o.equation == j]) / np.linalg.norm(o.y[o.equation == j])
            for j in range(len(o.equations))
        ]
    )


def judged(case: Spoilt, said: str) -> str:
    """Whether the sentence names kind and joints."""
    if "spoilt" not in said:
        return "not named"
    a, b = (*case.joints, "", "")[:2]
    sentences = said.split("spoilt: ")[1].split("; ")[0]
    right = WORDS[case.kind].format(a=a, b=b) in sentences if case.kind in WORDS else False
    if case.kind in ("torque gain", "channel late", "late"):
        right = right and ("ms" in sentences) == ("late" in case.kind)
    return ("one of two" if ", or the " in sentences else "named") if right else "wrong"


def run(
    robot: str, seed: int, log: Log, kind: str, sound: np.ndarray | None, choose: bool
) -> tuple[Outcome, np.ndarray]:
    """Identify from a spoilt log."""
    case = spoilt(log, kind, np.random.default_rng([seed, *kind.encode()]))
    began = time.process_time()
    try:
        result = excite.identify(robot, case.log, choose=choose)
    except InputError as error:
        own = Outcome(robot, seed, kind, case.joints, "refused", True, str(error), time.process_time() - began)
        return own, np.zeros(0)
    said = " | ".join(doubt.text for doubt in result.doubts)
    e = errors(result)
    shows = sound is None or bool(np.any(e > SHOWS * sound)) or kind in ("magnitudes", "clipped")
    own = Outcome(robot, seed, kind, case.joints, judged(case, said), shows, said, time.process_time() - began)
    return own, e


def text_of(outcomes: list[Outcome]) -> str:
    """How many logs of each kind are named right."""
    kinds = ("named", "one of two", "wrong", "not named", "refused")
    rows = []
    for kind in dict.fromkeys(o.kind for o in outcomes):
        own = [o for o in outcomes if o.kind == kind]
        rows.append([kind, len(own), *(sum(o.outcome == k for o in own) for k in kinds), sum(o.shows for o in own)])
    cases = [o for o in outcomes if o.kind != "clean"]
    right = sum(o.outcome in ("named", "one of two") for o in cases)
    accused = sum(o.outcome == "wrong" for o in outcomes if o.kind == "clean")
    head = ["fault", "logs", "named", "one of two", "wrong", "not named", "refused with exit status 2", "shows"]
    return (
        f"{right} of {len(cases)} spoilt logs are named right, joint and kind; {accused} of "
        f"{len(outcomes) - len(cases)} sound ones are accused.\n\n{record.table(head, rows)}"
    )


LIMITATIONS = (
    "One fault at a time. Simulated robots differ from their descriptions by up to 15 % of each body, with Coulomb and "
    "viscous friction and white noise of 2 % of each torque; a random Fourier motion of 10 s at 200 Hz each.",
    "`one of two`: the sentence names two faults that the log cannot tell apart, and the right one is among them. "
    "`shows`: the residual of a joint is 1.2 times that of the sound log, or the torques show it by themselves.",
    "Named without the choice of settings (`choose=False`), which takes most of the time of an identification.",
)


def main() -> None:
    """Run all cases and write them."""
    before = record.load()
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--robots", default=",".join(ROBOTS))
    parser.add_argument("--kinds", default=";".join(KINDS))
    parser.add_argument("--real", type=Path, help="folder of the real logs of a UR10e, which are used instead")
    parser.add_argument("--choose", action="store_true", help="choose the settings, as by default")
    a = parser.parse_args()
    if a.real:
        logs = [("ur10e", k, log) for k, log in enumerate(real_logs(a.real))]
    else:
        logs = [(r, s, clean_log(r, s)) for r in a.robots.split(",") for s in range(a.seeds)]
    outcomes = []
    for robot, seed, log in logs:
        clean, sound = run(robot, seed, log, "clean", None, a.choose)
        outcomes.append(clean)
        for kind in a.kinds.split(";"):
            outcomes.append(run(robot, seed, log, kind, sound, a.choose)[0])
            print(robot, seed, kind, outcomes[-1].outcome, outcomes[-1].said[:160], flush=True)
    name = "real" if a.real else "simulated"
    sys.argv = ["FOLDER" if a.real and Path(text) == a.real else text for text in sys.argv]  # no path of this machine
    record.save(name, before, {"cases": [asdict(o) for o in outcomes]}, text_of(outcomes), LIMITATIONS, HERE)


if __name__ == "__main__":
    main()
