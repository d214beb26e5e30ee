"""Stored designs that others changed are not believed, and parts that files name are not imported."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from commands import Here
from designed import irp6

import excite
from excite.registry import OwnPart
from excite.storage.manifest import FileHash, entry_sha256, read_manifest, write_manifest
from excite.views.write_report import report_text
from regressors.errors import InputError

# Stored designs whose files were changed by someone who also mended the hashes: no command believes them.


Content = dict[str, Any]
Change = Callable[[Content], None]


@pytest.fixture(scope="module")
def saved() -> Path:
    return irp6().folder


def tripled(content: Content) -> None:
    motion = content["trajectory"]
    motion |= {name: [[3 * x for x in row] for row in motion[name]] for name in ("cosine", "sine")}


def said_to_break(content: Content) -> None:
    content["limits"] = [{**use, "use": 2.0, "margin": -1.0, "holds": False} for use in content["limits"]]
    content["feasible"] = False


def without_limits(content: Content) -> None:
    tripled(content)
    content["limits"] = []


def better(content: Content) -> None:
    content["criteria"] = dict.fromkeys(content["criteria"], 1.234)
    content["base"]["rank"] = 99
    for each in content["predicted"]["parameters"]:
        each["standard_deviation"] = 1.234


BREAKING: tuple[Change, ...] = (tripled, without_limits)
KEEPING: tuple[Change, ...] = (said_to_break, better)
# Words of each command after the design's folder; its status and a text where the motion breaks its limits.
COMMANDS: dict[str, tuple[tuple[str, ...], int, str]] = {
    "compare": (("--verbose",), 0, "BROKEN"),
    "export": (("--format", "npz", "--out", "motion.npz"), 1, "the motion breaks a limit: "),
    "simulate": (("--out", "run.csv"), 1, "the motion breaks a limit: "),
    "predict": (("--torque-noise", "0.5", "--count", "10"), 1, "the motion breaks a limit: "),
    "bound": ((), 1, "), and a bound holds for motions within the limits only"),
}


def changed(saved: Path, folder: Path, change: Change, *, manifest: bool) -> Path:
    """A copy of the design with another ``design.json``, whose hashes are mended, or with none."""
    shutil.copytree(saved, folder)
    path = folder / "design.json"
    content = json.loads(path.read_text(encoding="utf-8"))
    change(content)
    if manifest:
        content["sha256"]["trajectory"] = entry_sha256(content["trajectory"])
    else:
        del content["sha256"]
    path.write_text(json.dumps(content), encoding="utf-8")
    known = read_manifest(folder)
    known["design"].files["design.json"] = FileHash.of(path)
    write_manifest(folder / "manifest.json", known)
    if not manifest:
        (folder / "manifest.json").unlink()
    return folder


@pytest.mark.parametrize(("change", "manifest"), [(tripled, True), (without_limits, False)], ids=["mended", "absent"])
@pytest.mark.parametrize("command", COMMANDS)
def test_a_motion_that_breaks_limits_is_not_believed(
    saved: Path, here: Here, command: str, change: Change, manifest: bool
) -> None:
    words, status, text = COMMANDS[command]
    changed(saved, here.cwd / "design", change, manifest=manifest)
    ended = here.run(command, "design", *words)
    assert (ended.returncode, text in ended.stdout + ended.stderr) == (status, True), ended
    assert not {"motion.npz", "run.csv"} & {path.name for path in here.cwd.iterdir()}


@pytest.mark.parametrize("change", BREAKING, ids=lambda change: change.__name__)
@pytest.mark.slow
def test_a_page_says_that_a_motion_breaks_limits(saved: Path, tmp_path: Path, change: Change) -> None:
    page = report_text(changed(saved, tmp_path / "design", change, manifest=True))
    assert "Design exceeds " in page
    assert "joint q2 position" in page
    assert "Design within all" not in page
    assert "imits kept" not in page


def alike(ours: Any, theirs: Any) -> bool:
    """Whether plain values are the same up to rounding: BLAS rounds by the alignment of memory."""
    if isinstance(ours, dict):
        return ours.keys() == theirs.keys() and all(alike(ours[name], theirs[name]) for name in ours)
    if isinstance(ours, list | tuple):
        return len(ours) == len(theirs) and all(map(alike, ours, theirs))
    return bool(ours == pytest.approx(theirs, rel=1e-10, abs=1e-12)) if isinstance(ours, float) else ours == theirs


@pytest.mark.parametrize("change", KEEPING, ids=lambda change: change.__name__)
@pytest.mark.slow
def test_what_a_file_says_of_a_motion_within_limits_is_computed(saved: Path, here: Here, change: Change) -> None:
    changed(saved, here.cwd / "design", change, manifest=True)
    true, read = excite.load_design(saved), excite.load_design(here.cwd / "design")
    stated = json.loads((saved / "design.json").read_text())["criteria"]
    assert true.criteria == {name: pytest.approx(value, rel=1e-9) for name, value in stated.items()}
    assert (read.broken, read.believed) == ((), ())
    assert alike(read.criteria, true.criteria)
    assert alike([vars(use) for use in read.limits], [vars(use) for use in true.limits])
    assert alike([vars(each) for each in read.predicted], [vars(each) for each in true.predicted])
    for command in ("compare", "export", "simulate"):
        here.run(command, "design", *COMMANDS[command][0], status=0)
    assert json.loads((here.cwd / "run.json").read_text())["design"].keys() == {"folder", "sha256"}
    page = report_text(here.cwd / "design")
    assert "checked is kept" in page
    assert f"condition number {true.condition_number:.4g}" in page
    assert ">1.234<" not in page


def test_what_cannot_be_computed_is_said_to_be_the_word_of_the_file(saved: Path, here: Here) -> None:
    def name_a_part(content: Content) -> None:
        content["task"]["constraints"] = ["mine:Mine"]
        content["limits"].append({**content["limits"][0], "label": "mine", "quantity": "mine", "method": "enclosed"})

    changed(saved, here.cwd / "design", name_a_part, manifest=True)
    design = excite.load_design(here.cwd / "design")
    (said,) = design.believed
    assert said.startswith("limits of torque, distance and mine are those that its file states: ")
    assert "mine:Mine" in said
    assert said.partition(": ")[0] in report_text(design)
    assert "are those that its file states" in here.run("compare", "design").stdout


def test_an_approach_to_another_motion_is_refused(saved: Path, tmp_path: Path) -> None:
    home = excite.load_design(saved).task.changed(home=(0.0, 0.1, -0.1, 0.0, 0.0))
    excite.design_trajectory(home).save(tmp_path / "home")
    folder = changed(tmp_path / "home", tmp_path / "design", tripled, manifest=True)
    with pytest.raises(excite.InputError, match="the approach does not meet the motion, by"):
        excite.load_design(folder)


# Files that name parts of a user's own: which are imported, by --part and in Python, and what is said without.


OWN = """
import excite

class Goal(excite.ConditionNumber):
    name = "goal"

class Series(excite.Fourier):
    name = "series"

class Model(excite.DifferentialModel):
    pass
"""
QUICK = ("--starts", "1", "--harmonics", "2", "--executor", "serial")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("own")


@pytest.fixture
def with_parts(folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Iterator[Here]:
    """A folder with a module, a design and a result that were made with its parts."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    (folder / "ours.py").write_text(OWN, encoding="utf-8")
    with_parts = Here(folder, monkeypatch, capfd)
    if not (folder / "result").exists():
        with_parts.designed("irp6", "--criterion", "ours:Goal", "--trajectory", "ours:Series", *QUICK, out="design")
        with_parts.designed("irp6", *QUICK, out="plain")
        for seed in ("1", "2"):
            log = f"run{seed}.csv"
            with_parts.run("simulate", "plain", "--out", log, "--torque-noise", "1", "--seed", seed, status=0)
        with_parts.run("identify", "irp6", "run1.csv", "--model", "ours:Model", "--out", "result", status=0)
    sys.modules.pop("ours", None)
    yield with_parts
    sys.modules.pop("ours", None)
    for name in ("again.csv", "again.json"):
        (folder / name).unlink(missing_ok=True)
    shutil.rmtree(folder / "again", ignore_errors=True)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "parts"),
    [
        (("compare", "design", "plain"), ("trajectory ours:Series", "criterion ours:Goal")),
        (("simulate", "design", "--out", "again.csv"), ("trajectory ours:Series",)),
        (("identify", "irp6", "run1.csv", "--design", "design", "--out", "again"), ("trajectory ours:Series",)),
        (("design", "irp6", *QUICK, "--begin", "design", "--out", "again"), ("trajectory ours:Series",)),
        (("verify", "result", "run2.csv", "--out", "again"), ("model ours:Model",)),
    ],
    ids=["compare", "simulate", "identify", "design", "verify"],
)
def test_commands_that_read_results(command: tuple[str, ...], parts: tuple[str, ...], with_parts: Here) -> None:
    allowed: list[str] = []
    for part in parts:
        refused, name = with_parts.run(*command, *allowed, status=2), part.split()[1]
        assert f"{part} is not built in" in refused.stderr
        assert f"--part {name} allows it" in refused.stderr
        allowed += ["--part", name]
    with_parts.run(*command, *allowed, status=0)


@pytest.mark.slow
def test_only_what_is_named_is_imported(with_parts: Here) -> None:
    with_parts.monkeypatch.chdir(with_parts.cwd)
    stored = excite.load_design("design", part="ours:Series")
    assert type(stored.trajectory.family).__name__ == "Series"
    assert stored.task.objective.criterion == OwnPart("criterion", "ours:Goal")
    with pytest.raises(InputError, match=r"`part='ours:Goal'` allows it, or in Python .* such as criterion=Goal"):
        excite.compare([stored])
    both = excite.load_design("design", part=["ours:Series", "ours:Goal"])
    assert excite.compare([both])[0].goal is not None
    sys.modules.pop("ours")
    excite.load_design("plain", part="ours:Goal")  # names nothing of it
    assert "ours" not in sys.modules
