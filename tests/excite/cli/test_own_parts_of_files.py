"""Files that name parts of a user's own: which are imported, by --part and in Python, and what is said without."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from commands import Here

import excite
from excite.registry import OwnPart
from regressors.errors import InputError

pytestmark = pytest.mark.slow

OWN = """
import numpy as np
import excite

class Goal(excite.Criterion):
    name = "goal"
    stages = (1.0,)

    def value(self, M):
        return float(-np.linalg.slogdet(M)[1])

    def smooth(self, M, sharpness):
        return -np.linalg.slogdet(M)[1], -np.linalg.inv(M)

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
def here(folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Iterator[Here]:
    """A folder with a module, a design and a result that were made with its parts."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    (folder / "ours.py").write_text(OWN, encoding="utf-8")
    here = Here(folder, monkeypatch, capfd)
    if not (folder / "result").exists():
        here.designed("irp6", "--criterion", "ours:Goal", "--trajectory", "ours:Series", *QUICK, out="design")
        here.designed("irp6", *QUICK, out="plain")
        for seed in ("1", "2"):
            log = f"run{seed}.csv"
            ended = here.run("simulate", "plain", "--out", log, "--torque-noise", "1", "--seed", seed)
            assert ended.returncode == 0, ended.stderr
        ended = here.run("identify", "irp6", "run1.csv", "--model", "ours:Model", "--out", "result")
        assert ended.returncode == 0, ended.stderr
    sys.modules.pop("ours", None)
    yield here
    sys.modules.pop("ours", None)
    for name in ("again.csv", "again.json"):
        (folder / name).unlink(missing_ok=True)
    shutil.rmtree(folder / "again", ignore_errors=True)


def test_compare(here: Here) -> None:
    refused = here.run("compare", "design", "plain")
    assert refused.returncode == 2
    assert "trajectory ours:Series is not built in" in refused.stderr
    assert "--part ours:Series allows it" in refused.stderr
    refused = here.run("compare", "design", "plain", "--part", "ours:Series")
    assert (refused.returncode, len(refused.stderr.splitlines())) == (2, 1)
    assert "--part ours:Goal allows it" in refused.stderr
    ended = here.run("compare", "design", "plain", "--part", "ours:Series", "--part", "ours:Goal")
    assert (ended.returncode, ended.stderr) == (0, "")
    assert "ours:Goal" in ended.stdout


def test_verify(here: Here) -> None:
    refused = here.run("verify", "result", "run2.csv", "--out", "again")
    assert refused.returncode == 2
    assert "model ours:Model is not built in" in refused.stderr
    assert "--part ours:Model allows it" in refused.stderr
    ended = here.run("verify", "result", "run2.csv", "--out", "again", "--part", "ours:Model")
    assert ended.returncode == 0, ended.stderr


@pytest.mark.parametrize(
    "command",
    [
        ("simulate", "design", "--out", "again.csv"),
        ("identify", "irp6", "run1.csv", "--design", "design", "--out", "again"),
        ("design", "irp6", *QUICK, "--begin", "design", "--out", "again"),
    ],
    ids=["simulate", "identify", "design"],
)
def test_other_commands_that_read_designs(command: tuple[str, ...], here: Here) -> None:
    refused = here.run(*command)
    assert refused.returncode == 2
    assert "--part ours:Series allows it" in refused.stderr
    ended = here.run(*command, "--part", "ours:Series")
    assert ended.returncode == 0, ended.stderr


def test_friction_fit_reads_results(here: Here) -> None:
    """The log has no windows of constant speed, so that the fit is refused in the end."""
    command = ("friction", "fit", "irp6", "run1.csv", "--parameters", "result", "--out", "again")
    assert "--part ours:Model allows it" in here.run(*command).stderr
    ended = here.run(*command, "--part", "ours:Model")
    assert (ended.returncode, "ours:Model" in ended.stderr) == (2, False)


def test_only_what_is_named_is_imported(here: Here) -> None:
    here.monkeypatch.chdir(here.cwd)
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


def test_a_part_that_is_no_name(here: Here) -> None:
    ended = here.run("compare", "plain", "--part", "ours")
    assert (ended.returncode, ended.stdout) == (2, "")
    assert "Invalid value for '--part': expected MODULE:NAME, given 'ours'" in ended.stderr
