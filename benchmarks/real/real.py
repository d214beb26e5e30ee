"""Real logs: ours with plain defaults beside rivals that are reimplemented briefly, on frozen splits.

``python benchmarks/real/real.py FOLDER [--out DIR] [--jobs N] [--only ROBOT]``. FOLDER has the folders ``ur10e`` and
``kr300`` with the logs of splits.yaml; what is absent is skipped and said. Nothing is fetched.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import record
from interval_agreement import agreements
from real_text import page
from ruamel.yaml import YAML

HERE = Path(__file__).resolve().parent
LIMITATIONS = (
    "two robots, eight logs; the splits of one robot share logs and are not independent",
    "the error is ||tau - tau_predicted|| / ||tau|| over all joints, of raw torques at the log's own instants that "
    "`excite.verify` judges (the exciting rows that it finds, less what its filter cuts at the ends); rivals are "
    "judged on the same instants against the same torques, and trained on the exciting rows that the tool found, which "
    "they do not have to find themselves",
    "UR10e: torques are measured currents times published gains, which are some 9 % off; KR300: its counterbalance is "
    "in no model, the bodies of its URDF are placeholders, and a tool of some 200 kg is not described",
    "rivals: positions by cubic splines and torques linearly on uniform instants, both through a zero-phase "
    "Butterworth of order 4 (5 or 10 Hz), central differences twice, 36 base parameters and rotors, exact sign of the "
    "velocity; no delay; predicted torques are interpolated linearly; the torque that joints carry, for load shares, "
    "is that of a weighted fit without them",
    "intervals: OLS and weighted with white residuals, Coulomb, viscous and offset; ours as it states them. Ours are "
    "compared where a parameter has the same expression in both results and, of friction, its drive the same terms; "
    "two logs of one robot differ also in temperature and day",
    "processor time of one process with one thread each: of ours `excite.identify` with reading and all choices, of "
    "rivals filter, regressor and estimate, without reading and without finding rows; the median over friction and "
    "filter",
)


def main() -> None:
    """Run every training set and write the page."""
    options = _options()
    # one thread per process: they would only wait for each other
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    before, began = record.load(), time.monotonic()
    study, skipped = _present(options)
    if not study:
        sys.exit(f"{options.folder} has the logs of no split of splits.yaml")
    jobs = [(name, train) for name, robot in study.items() for train in _trainings(robot)]
    found: dict[str, dict[tuple[str, ...], dict[str, Any]]] = {name: {} for name in study}
    for name, case in _cases(options, study, jobs):
        found[name][tuple(case["train"])] = case
        done = sum(len(cases) for cases in found.values())
        print(
            f"{time.monotonic() - began:4.0f} s, {done} of {len(jobs)}: {name}, {' + '.join(case['train'])}",
            file=sys.stderr,
            flush=True,
        )
    robots = {name: _robot(robot, name, found[name]) for name, robot in study.items()}
    sys.argv[1:] = _shown(sys.argv[1:], options.folder)
    out = options.out or HERE
    out.mkdir(parents=True, exist_ok=True)
    record.save("real", before, {"skipped": skipped, "robots": robots}, page(robots, skipped), LIMITATIONS, folder=out)
    print(f"{time.monotonic() - began:.0f} s in all", file=sys.stderr)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="with the folders of splits.yaml")
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder of results/real.json and .md (default: here)")
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="processes (default 2)")
    parser.add_argument("--only", metavar="ROBOT", help="one robot of splits.yaml")
    options = parser.parse_args()
    if not options.folder.is_dir():
        parser.error(f"{options.folder} is not a folder")
    return options


def _shown(arguments: list[str], folder: Path) -> list[str]:
    """The arguments without a path of this machine."""
    return ["FOLDER" if Path(text) == folder else text for text in arguments]


def _present(options: argparse.Namespace) -> tuple[dict[str, Any], list[str]]:
    """The robots and splits whose files are there, and why the others are skipped."""
    study: dict[str, Any] = YAML(typ="safe").load(HERE / "splits.yaml")
    if options.only is not None:
        study = {options.only: study[options.only]}
    kept, skipped = {}, []
    for name, robot in study.items():
        absent = {log for log, file in robot["logs"].items() if not (options.folder / robot["folder"] / file).is_file()}
        if "/" in robot["robot"] and not (options.folder / robot["robot"]).is_file():
            skipped.append(f"{name}: absent from the folder: {robot['robot']}")
            continue
        for split in robot["splits"]:
            if missing := absent & {*split["train"], split["test"]}:
                files = ", ".join(f"{robot['folder']}/{robot['logs'][log]}" for log in sorted(missing))
                skipped.append(f"{split_name(name, split)}: absent from the folder: {files}")
        splits = [split for split in robot["splits"] if not absent & {*split["train"], split["test"]}]
        if splits:
            kept[name] = {**robot, "splits": splits}
    for reason in skipped:
        print(f"skipped: {reason}", file=sys.stderr)
    return kept, skipped


def split_name(robot: str, split: dict[str, Any]) -> str:
    """Such as ``ur10e 40sec -> 50sec``."""
    return f"{robot} {' + '.join(split['train'])} -> {split['test']}"


def _trainings(robot: dict[str, Any]) -> list[tuple[str, ...]]:
    return list(dict.fromkeys(tuple(split["train"]) for split in robot["splits"]))


def _cases(
    options: argparse.Namespace, study: dict[str, Any], jobs: list[tuple[str, tuple[str, ...]]]
) -> Iterator[tuple[str, dict[str, Any]]]:
    from training_case import training_case

    with ProcessPoolExecutor(options.jobs, mp_context=get_context("spawn")) as pool:
        running = {}
        for name, train in sorted(jobs, key=lambda job: -len(job[1])):  # the longest first
            tests = [split["test"] for split in study[name]["splits"] if tuple(split["train"]) == train]
            running[pool.submit(training_case, options.folder, study[name], list(train), tests)] = name
        for done in as_completed(running):
            yield running[done], done.result()


def _robot(robot: dict[str, Any], name: str, cases: dict[tuple[str, ...], dict[str, Any]]) -> dict[str, Any]:
    """Cases in the order of the splits, what each split shows, and agreement of intervals."""
    ordered = [cases[train] for train in _trainings(robot)]
    splits = [_split(split_name(name, split), cases[tuple(split["train"])], split["test"]) for split in robot["splits"]]
    told = {key: robot[key] for key in ("origin", "licence")}
    agreed = agreements(ordered, robot["pairs"])
    return {**told, "splits": splits, "agreements": agreed, "cases": [_without_errors(case) for case in ordered]}


def _without_errors(case: dict[str, Any]) -> dict[str, Any]:
    """A case without what the splits tell."""
    rivals = [{key: value for key, value in rival.items() if key != "tests"} for rival in case.get("rivals", ())]
    return {**{key: value for key, value in case.items() if key != "tests"}, "rivals": rivals}


def _split(name: str, case: dict[str, Any], test: str) -> dict[str, Any]:
    if "refused" in case:
        return {"name": name, "refused": case["refused"]}
    rivals = {
        f"{rival['estimator']}, {rival['friction']}, {rival['cutoff']:g} Hz": {
            **{key: rival[key] for key in ("estimator", "friction", "cutoff")},
            **rival["tests"][test],
        }
        for rival in case["rivals"]
    }
    best = min(rivals, key=lambda key: rivals[key]["error"])
    ours = case["tests"][test]
    training = case["ours"]["training_error"]
    return {
        "name": name,
        "ours": ours,
        "training_error": training,
        "rivals": rivals,
        "best": {"name": best, **rivals[best]},
    }


if __name__ == "__main__":
    main()
