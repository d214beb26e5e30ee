"""``excite export`` of a result: a model that other programs load."""

from __future__ import annotations

import hashlib
import json
import signal
from pathlib import Path

import pytest
from commands import Here
from processes import running, stderr_of, until
from written_results import design, result

from excite.cli.export_command import command
from excite.registry import MODEL_FORMATS


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("made")
    result("old").save(made / "r")
    result("old").save(made / "both")
    design("old").save(made / "both")
    return made


@pytest.fixture
def here(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Here:
    for made in folder.iterdir():
        (tmp_path / made.name).symlink_to(made)
    return Here(tmp_path, monkeypatch, capfd)


def test_the_summary_as_text_and_as_json(here: Here) -> None:
    arguments = ("export", "r", "--format", "urdf", "--out", "models/irp6.urdf")
    text = here.run(*arguments).stdout
    assert "written: models/irp6.urdf" in text
    assert "note: URDF cannot express rotor inertias" in text
    content = json.loads(here.run(*arguments, "--force", "--json").stdout)
    assert (content["format"], content["files"]) == ("urdf", ["models/irp6.urdf"])
    assert any("drives that move several joints" in note for note in content["notes"])
    sha256 = hashlib.sha256((here.cwd / "r" / "result.json").read_bytes()).hexdigest()
    assert sha256 in (here.cwd / "models" / "irp6.urdf").read_text()


@pytest.mark.parametrize("form", MODEL_FORMATS)
def test_every_format_is_written(form: str, here: Here) -> None:
    where = "r" if form == "npz" else "both"  # a motion has that format too
    assert here.run("export", where, "--format", form, "--out", f"models/a.{form}").returncode == 0
    assert (here.cwd / "models" / f"a.{form}").stat().st_size > 500
    assert form in (command.epilog or "")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("r", "--format", "urdf", "--robot-file", "none.urdf"), ("cannot read", "none.urdf")),
        (("r", "--format", "csv", "--robot-file", "none.urdf"), ("--robot-file", "takes none")),
        (("r", "--format", "urdf", "--rate", "100"), ("--rate",)),
        (("both", "--format", "npz"), ("result.json", "design.json")),
        (("r", "--format", "urdf", "--seed", "1"), ("--seed", "--samples N")),
        (("r", "--format", "urdf", "--samples", "0"), ("--samples",)),
        (("both/design.json", "--format", "npz", "--samples", "3"), ("--samples", "holds a design")),
        (("r", "--format", "krl"), ("krl is a format of motions", "holds a result", "choose urdf")),
    ],
)
def test_what_does_not_fit_is_one_line_and_no_file(
    here: Here, arguments: tuple[str, ...], words: tuple[str, ...]
) -> None:
    said = here.refused("export", *arguments, "--out", "models/new.urdf")
    assert all(word in said for word in words), said


def test_a_file_that_is_there_stays_without_force(here: Here) -> None:
    (here.cwd / "a.csv").write_text("mine")
    ended = here.run("export", "r", "--format", "csv", "--out", "a.csv")
    assert (ended.returncode, "--force" in ended.stderr) == (2, True)
    assert (here.cwd / "a.csv").read_text() == "mine"
    assert here.run("export", "r", "--format", "csv", "--out", "a.csv", "--force").returncode == 0


def test_an_ensemble_is_a_folder_of_robots(here: Here) -> None:
    arguments = ("export", "r", "--format", "mjcf", "--samples", "3", "--level", "0.6", "--out", "models/many")
    text = here.run(*arguments).stdout
    assert "Ensemble of 3 possible robots exported as mjcf" in text
    names = {path.name for path in (here.cwd / "models" / "many").iterdir()}
    assert names == {"ensemble.json", "ranges.yaml", "samples.npz", *(f"irp6-000{k}.xml" for k in (1, 2, 3))}
    again = here.run(*arguments)
    assert (again.returncode, "--force" in again.stderr) == (2, True)
    content = json.loads(here.run(*arguments, "--force", "--json").stdout)
    assert (content["format"], content["robots"], len(content["files"])) == ("mjcf", 3, 6)


@pytest.mark.slow
def test_what_is_written_of_an_ensemble_stays_after_ctrl_c(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "many"
    with running(
        tmp_path, "export", str(folder / "r"), *["--format", "mjcf", "--samples", "2000", "--out", "many"]
    ) as process:
        until((out / "irp6-0003.xml").exists)
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 130
    assert "interrupted" in (tmp_path / "stdout").read_text()
    stderr_of(tmp_path)
    content = json.loads((out / "ensemble.json").read_text())
    assert content["interrupted"] is True
    assert set(content["files"]) == {path.name for path in out.iterdir()} - {"ensemble.json"}
    assert 3 <= sum(name.endswith(".xml") for name in content["files"]) < 2000
