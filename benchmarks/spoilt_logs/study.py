"""How often the fault of a spoilt log is named right, and how often a sound log is accused.

.venv/bin/python benchmarks/spoilt_logs/study.py [--seeds 10-10] [--sound 11-20] [--robots NAMES] [--kinds NAMES]
    [--real FOLDER] [--centres METRES] [--stribeck SHARE] [--memory SECONDS] [--choose] [--processes 2]
    [--name simulated]
"""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import record
import spoilt as simulated
from real_logs import real_logs
from spoilt import (
    KINDS,
    ROBOTS,
    Spoilt,
    changed_from,
    clean_log,
    load,
    mount,
    relative,
    spoilt,
    with_repeated_rows,
)

import excite
from excite.identification.fault_search import FaultSearch
from excite.identification.log_faults import NO_FAULT
from excite.identification.prediction import instantaneous_target
from excite.logs.log import Log
from excite.tasks.installation import Installation
from excite.tasks.payload import installed
from regressors.errors import InputError
from regressors.readers.library import load_robot

HERE = Path(__file__).resolve().parent
RIGHT = ("named", "one of two", "handled")
HANDLED = ("clock jump", "lost rows", "stale rows", "repeated rows")  # may do no harm: rows are left out or bridged
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
    "late from": "s on all torques are",
    "drift": "the friction of",
    "clock jump": "the clock jumps by",
}


@dataclass(frozen=True)
class Outcome:
    """What was said of one log."""

    robot: str
    seed: int
    kind: str
    joints: tuple[str, ...]
    truth: tuple[float, ...]  # factors of the joints, or gravity
    outcome: str  # named, one of two, wrong, not named, refused
    shows: bool
    said: str
    seconds: float


def errors(result: excite.Identification) -> np.ndarray:
    """Errors of the joints in the best fit that undoes no fault, the described robot believed a little."""
    target = instantaneous_target(result.robot, result.task, result.recipe)
    return FaultSearch.of(target, result.prepared, result.friction).plain.fit(NO_FAULT).errors


def judged(case: Spoilt, said: str) -> str:
    """Whether the sentence names kind and joints, or values that mend the log."""
    if case.kind == "untold load" and "seems to carry something" in said and "spoilt" not in said:
        mass = float(re.search(r"a load of ([\d.e+-]+) kg", said)[1])
        return "named" if abs(np.log(mass / case.truth[0])) < np.log(1.4) else "wrong"
    refused_for = {"repeated rows": "`drop='repeated'`", "lost rows": "rows were lost"}
    if refused_for.get(case.kind, "spoilt: ") in said and case.kind in refused_for:
        return "named"
    if "spoilt" not in said:
        named_by_unit = case.kind == "torque gain" and f"{case.joints[0]}.effort" in said and "mNm would" in said
        return "named" if named_by_unit else "refused" if said.startswith("refused") else "not named"
    a, b = (*case.joints, "", "")[:2]
    sentences = said.split("spoilt: ")[1].split("; ")[0]
    if case.kind in ("currents", "drive units"):
        right = factors_right(case, sentences)
    elif case.kind == "gravity":
        right = gravity_right(case, sentences)
    elif case.kind == "moved base":
        right = (
            "s on the base is tilted" in sentences and gravity_right(case, sentences) and time_right(case, sentences)
        )
    elif case.kind == "other lengths":
        right = lengths_right(case, sentences)
    else:
        right = WORDS[case.kind].format(a=a, b=b) in sentences if case.kind in WORDS else False
    if case.kind == "late from":
        right = right and time_right(case, sentences)
    if case.kind in ("torque gain", "channel late", "late"):
        right = right and ("ms" in sentences) == ("late" in case.kind) and "would need" not in sentences
    return ("one of two" if ", or the " in sentences else "named") if right else "wrong"


def factors_right(case: Spoilt, sentences: str) -> bool:
    """Whether the factors of the joints that are named are the true ones within 40 %.

    All are relative to their median where no masses are described. Of three joints, one's may be relative to another's;
    of more joints, to blame a single one is wrong.
    """
    true = dict(zip(case.log.joints, case.truth, strict=True))
    for joints, values, how in re.findall(r"torques of ([\w, ]+?) are ([\d.e+, -]+) times what ([\w ]+)", sentences):
        names, said = joints.split(", "), [float(x) for x in values.split(", ")]
        others = [factor for name, factor in true.items() if name not in names and len(true) == 3]
        references = [1.0] if "described" in how else [np.median(case.truth)] if "together" in how else others
        ratios = [[true[name] / reference / x for name, x in zip(names, said, strict=True)] for reference in references]
        if any(np.abs(np.log(ratio)).max() < np.log(1.4) for ratio in ratios):
            return True
    return False


def time_right(case: Spoilt, sentences: str) -> bool:
    """Whether the time from which on something changed is the true one within a tenth of the log."""
    said = re.search(r"from ([\d.e+-]+) s on", sentences)
    return said is not None and abs(float(said[1]) - case.truth[0]) < 0.1 * case.log.duration


def lengths_right(case: Spoilt, sentences: str) -> bool:
    """Whether the lengths that are stated are the true ones within 15 %."""
    said = re.search(r"the lengths up to ([\w, ]+) are ([\d., ]+) times those described", sentences)
    if said is None:
        return False
    true = dict(zip(case.log.joints, case.truth, strict=True))
    ratios = [true[name] / float(x) for name, x in zip(said[1].split(", "), said[2].split(", "), strict=True)]
    return bool(np.abs(np.log(ratios)).max() < np.log(1.15))


def gravity_right(case: Spoilt, sentences: str) -> bool:
    """Whether gravity is the true one within 15 degrees, about what masses that are off by 15 % leave open."""
    said = re.search(r"gravity is \(([^)]*)\)", sentences)
    if said is None:
        return False
    g, true = np.array([float(x) for x in said[1].split(",")]), np.array(case.truth[-3:])
    return bool(g @ true > np.cos(np.deg2rad(15.0)) * np.linalg.norm(g) * np.linalg.norm(true))


def case_of(robot: str, seed: int, log: Log, kind: str, real: bool) -> tuple[Spoilt, dict[str, object]]:
    """A spoilt log, and how the robot is said to be mounted; a real base stays, and another one is said."""
    rng = np.random.default_rng([seed, *kind.encode()])
    if kind in ("moved base", "late from", "drift", "clock jump", "lost rows", "stale rows"):
        return changed_from(log, kind, rng, robot, seed, real), {}
    if kind == "other lengths":
        own, other = replace(spoilt(log, "clean", rng), kind=kind), relative(load_robot(robot), rng)
        lengths = [np.linalg.norm([j.translation for j in r.joints], axis=1) for r in (load_robot(robot), other)]
        return replace(own, truth=tuple((lengths[0] / np.maximum(lengths[1], 1e-9)).tolist())), {"model": other}
    if kind == "untold load":
        carried = load(robot, rng)
        own = spoilt(clean_log(robot, seed, payload=carried), "clean", rng)
        return replace(own, kind=kind, truth=carried), {}
    if kind == "repeated rows":
        return replace(spoilt(log, "clean", rng), kind=kind), {"again": rng}
    if not kind.startswith("gravity"):
        return spoilt(log, kind, rng), {}
    mounted = mount(kind, rng)
    if real:
        gravity = load_robot(robot).gravity
        return replace(spoilt(log, "clean", rng), kind="gravity", truth=tuple(gravity.tolist())), {"mount": mounted}
    gravity = installed(load_robot(robot), Installation(mount=mounted)).gravity
    own = spoilt(clean_log(robot, seed, mounted), "clean", rng)
    return replace(own, kind="gravity", truth=tuple(gravity.tolist())), {}


def run(
    robot: str, seed: int, log: Log, kind: str, sound: np.ndarray | None, *, choose: bool, real: bool
) -> tuple[Outcome, np.ndarray]:
    """Identify from a spoilt log."""
    case, options = case_of(robot, seed, log, kind, real)
    model, again = options.pop("model", robot), options.pop("again", None)
    began = time.process_time()
    try:
        with tempfile.TemporaryDirectory() as folder:
            given = case.log if again is None else with_repeated_rows(case.log, again, Path(folder))
            result = excite.identify(model, given, choose=choose, **options)
    except InputError as error:
        said, shows, e = f"refused: {error}", True, np.zeros(0)
    else:
        told = (*result.doubts, *(result.warnings if kind == "untold load" else ()))
        said, e = " | ".join(doubt.text for doubt in told), errors(result)
        shows = sound is None or bool(np.any(e > SHOWS * sound)) or kind in ("magnitudes", "clipped")
    seconds = time.process_time() - began
    outcome = judged(case, said)
    if kind in HANDLED and outcome == "not named" and not shows:
        outcome = "handled"
    return Outcome(robot, seed, kind, case.joints, case.truth, outcome, shows, said, seconds), e


def runs(given: tuple[str, int, Log | None, list[str], bool]) -> list[Outcome]:
    """All kinds of faults of one log, after the sound one."""
    robot, seed, recorded, kinds, choose = given
    how = {"choose": choose, "real": recorded is not None}
    log = clean_log(robot, seed) if recorded is None else recorded
    clean, sound = run(robot, seed, log, "clean", None, **how)
    outcomes = [shown(clean), *(shown(run(robot, seed, log, kind, sound, **how)[0]) for kind in kinds)]
    clean_log.cache_clear()
    return outcomes


def shown(o: Outcome) -> Outcome:
    """The same, printed."""
    print(o.robot, o.seed, o.kind, o.outcome, o.shows, f"{o.seconds:.1f} s", o.said[:160], flush=True)
    return o


def printed(files: list[Path]) -> list[Outcome]:
    """The outcomes that runs printed before they were stopped."""
    line = re.compile(
        r"(\S+) (\d+) (.+?) (not named|one of two|named|handled|wrong|refused) (True|False) ([\d.]+) s (.*)"
    )
    found = [match for file in files for text in file.read_text().splitlines() if (match := line.fullmatch(text))]
    return [
        Outcome(robot, int(seed), kind, (), (), outcome, shows == "True", said, float(seconds))
        for robot, seed, kind, outcome, shows, seconds, said in (match.groups() for match in found)
    ]


def text_of(outcomes: list[Outcome]) -> str:
    """How many logs of each kind are named right."""
    kinds = ("named", "one of two", "handled", "wrong", "not named", "refused")
    rows = []
    for kind in dict.fromkeys(o.kind for o in outcomes):
        own = [o for o in outcomes if o.kind == kind]
        rows.append([kind, len(own), *(sum(o.outcome == k for o in own) for k in kinds), sum(o.shows for o in own)])
    cases = [o for o in outcomes if o.kind != "clean"]
    right = sum(o.outcome in RIGHT for o in cases)
    can_be = sum(o.shows or o.outcome in RIGHT for o in cases)
    accused = sum(o.outcome == "wrong" for o in outcomes if o.kind == "clean")
    head = [
        "fault",
        "logs",
        "named",
        "one of two",
        "handled",
        "wrong",
        "not named",
        "refused with exit status 2",
        "shows",
    ]
    return (
        f"{right} of {len(cases)} spoilt logs are named right, joint and kind, and of the {can_be} that show a fault "
        f"{right / max(can_be, 1):.1%}; {sum(o.outcome == 'wrong' for o in cases)} are named wrong, and {accused} of "
        f"{len(outcomes) - len(cases)} sound ones accused.\n\n{record.table(head, rows)}"
    )


LIMITATIONS = (
    "One fault at a time. Simulated robots differ from their descriptions by up to 15 % of each body, with Coulomb and "
    "viscous friction and white noise of 2 % of each torque; a random Fourier motion of 10 s at 200 Hz each.",
    "`one of two`: the sentence names two faults that the log cannot tell apart, and the right one is among them. "
    "`shows`: in the best fit that undoes no fault, with the described robot believed a little, the error of a joint "
    "is 1.2 times that of the sound log, or the torques or a limit show it by themselves. What does not show is a zero "
    "about a vertical axis, one that the parameters of the last body take up, a gain of a joint that friction alone "
    "moves, and what noise hides.",
    "Right are factors within 40 % (of three joints, one's relative to another's) and a direction of gravity "
    "within 15 degrees. Currents have factors of 1/20 to 1/2 a joint; drive units some 100 at the largest torque.",
    "A robot that refuses its log (exit status 2) and says why counts as named. `handled` are rows that were lost, "
    "held or written twice with errors as of the sound log, since they are bridged or left out.",
    "The base moves by 10 to 30 degrees, torques are late by 20 to 80 ms from some time on, friction (of a real arm, "
    "as identified from the log) falls by 30 to 50 %, lengths are off by 10 to 60 %, a load has 0.3 to 0.8 times the "
    "rated mass, clocks jump by 0.2 to 1 s. Right are a time within a tenth of the log, lengths within 15 %, the mass "
    "of a load within 40 %.",
)


def seeds_of(text: str) -> range:
    """The seeds of ``2-7`` or ``8``, which is 0 to 7."""
    first, _, last = text.rpartition("-")
    return range(int(first), int(last) + 1) if first else range(int(last))


def main() -> None:
    """Run all cases and write them."""
    before = record.load()
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=seeds_of, default=range(10, 11))
    parser.add_argument("--sound", type=seeds_of, default=range(0), help="seeds of further logs that are not spoilt")
    parser.add_argument("--robots", default=",".join(ROBOTS))
    parser.add_argument("--kinds", default=";".join(KINDS))
    parser.add_argument("--real", type=Path, help="folder of the real logs of a UR10e, which are used instead")
    parser.add_argument("--centres", type=float, default=0.0, help="standard deviation of the bodies' centres [m]")
    parser.add_argument("--stribeck", type=float, default=0.0, help="of Coulomb friction, that no model has")
    parser.add_argument("--memory", type=float, default=0.0, help="time over which the noise is correlated [s]")
    parser.add_argument("--choose", action="store_true", help="choose the settings, as by default")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--name", help="of the results; simulated or real if not given")
    parser.add_argument("--printed", type=Path, nargs="*", default=[], help="what stopped runs printed, to be counted")
    a = parser.parse_args()
    kinds, robots = a.kinds.split(";"), a.robots.split(",")
    simulated.CENTRES, simulated.STRIBECK, simulated.MEMORY = a.centres, a.stribeck, a.memory
    if a.real:
        kinds = [kind for kind in kinds if kind != "untold load"]
        given = [("ur10e", k, log, kinds, a.choose) for k, log in enumerate(real_logs(a.real))]
    else:
        given = [(r, s, None, kinds, a.choose) for s in a.seeds for r in robots]
        given += [(r, s, None, [], a.choose) for s in a.sound if s not in a.seeds for r in robots]
    if a.printed:
        outcomes = printed(a.printed)
    else:
        with ProcessPoolExecutor(a.processes) as pool:
            outcomes = [outcome for one in pool.map(runs, given) for outcome in one]
    files = [a.real, *a.printed]
    sys.argv = ["FILE" if Path(text) in files else text for text in sys.argv]  # no path of this machine
    name = a.name or ("real" if a.real else "simulated")
    off = (
        f"Centres of the true bodies are off by {1e3 * a.centres:g} mm (standard deviation of a coordinate); friction "
        f"is {100 * a.stribeck:g} % higher at standstill (Stribeck), noise correlated over {1e3 * a.memory:g} ms."
    )
    settings = "With the choice of settings." if a.choose else "Without the choice of settings (`choose=False`)."
    cases = {"cases": [asdict(o) for o in outcomes]}
    record.save(name, before, cases, text_of(outcomes), (*LIMITATIONS, off, settings), HERE)


if __name__ == "__main__":
    main()
