"""The degradation study: plain defaults against the best fixed choice in hindsight, on degraded simulated logs.

``python benchmarks/degradation/study.py [--quick] [--jobs N] [--cases DIR]``; a case that is in DIR, made by the same
source, is not computed again.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import record
from cases import CASES, QUICK
from study_text import judged, study_text, summary
from subjects import ROBOTS

from excite.storage.atomic import read_json, write_json

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
LIMITATIONS = (
    "simulated robots: rigid links, friction of Coulomb and viscous kind; what real robots have beyond that, such as "
    "friction that grows with the load or elasticity, is not in it",
    "one motion of 10 s at 1 kHz to train on and one to judge by, designed from one start each; one seed of the noise: "
    "ratios within some per cent of 1.3 or 2 may fall on either side with another seed",
    "the training and the unseen log are degraded alike, so that what both have in common, such as wrong gains or a "
    "payload, is no error against the raw torque; the columns of the true torque show what it is worth",
    "the best fixed choice is the minimum over 360 weighted and 6 physical fits on the unseen log itself; no choice "
    "that sees the training log alone can reach it in every case, and the default may be better where the table has no "
    "such choice (ratios below 1)",
    "the best fixed choice is computed from every tenth instant, the default from all",
    "a cause counts as named where a message has a word for it (causes.py) that is not said of the undegraded log",
)


def main() -> None:
    """Run the cases and write the page."""
    options = _options()
    # one thread per process: they would only wait for each other
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    before = record.load()
    wanted = [(robot, k) for robot in ROBOTS for k, case in enumerate(CASES) if not options.quick or case.name in QUICK]
    options.cases.mkdir(parents=True, exist_ok=True)
    results = dict(_known(options.cases, wanted))
    for key, result in _computed([key for key in wanted if key not in results], options.jobs):
        write_json(_file(options.cases, key), {"source": SOURCE, **result})
        results[key] = result
        print(f"{len(results)} of {len(wanted)}: {key[0]}, {CASES[key[1]].name}", file=sys.stderr, flush=True)
    told = judged([results[key] for key in wanted])
    name = "degradation_quick" if options.quick else "degradation"
    record.save(name, before, {"summary": summary(told), "results": told}, study_text(told), LIMITATIONS, HERE)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="five cases of each robot")
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="processes (default 2)")
    parser.add_argument(
        "--cases", type=Path, default=HERE / "results" / "cases", metavar="DIR", help="finished cases, to go on from"
    )
    return parser.parse_args()


def _source() -> str:
    """Hash of all source that a case depends on."""
    files = [path for folder in ("regressors", "constraints", "excite") for path in (ROOT / folder).rglob("*.py")]
    study = [HERE / f"{name}.py" for name in ("cases", "subjects", "fixed_choices", "case_result")]
    digest = hashlib.sha256()
    for path in sorted([*files, *study]):
        digest.update(path.read_bytes())
    return digest.hexdigest()


SOURCE = _source()


def _file(folder: Path, key: tuple[str, int]) -> Path:
    case = "".join(c if c.isalnum() else "-" for c in CASES[key[1]].name)
    return folder / f"{key[0]}-{case}.json"


def _known(folder: Path, wanted: list[tuple[str, int]]) -> Iterator[tuple[tuple[str, int], dict[str, Any]]]:
    for key in wanted:
        if _file(folder, key).exists():
            content = read_json(_file(folder, key))
            if content.pop("source", None) == SOURCE:
                yield key, content


def _computed(keys: list[tuple[str, int]], jobs: int) -> Iterator[tuple[tuple[str, int], dict[str, Any]]]:
    from case_result import result_of

    if jobs <= 1:
        for key in keys:
            yield key, result_of(*key)
        return
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        running = {pool.submit(result_of, *key): key for key in keys}
        for done in as_completed(running):
            yield running[done], done.result()


if __name__ == "__main__":
    main()
