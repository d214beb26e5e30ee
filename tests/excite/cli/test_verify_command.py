"""``excite verify``: exit status, files and words of a verdict, and what is refused without leaving anything behind."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest
from commands import Here, files_below
from played import link_files
from recordings import write_sidecar

from excite.cli.main import main
from excite.logs.log_reading import read_log, write_log
from excite.views import figures
from regressors.readers.library import built_in

DRAW = figures.write_figures


@pytest.fixture(scope="module")
def files(recorded_files: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Logs and results: ``result`` of ``run.csv``, ``masses`` with friction that was known."""
    folder = tmp_path_factory.mktemp("files")
    link_files(recorded_files, folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr(figures, "write_figures", lambda *_, **__: [])
        for name, more in (("result", ()), ("masses", ("--friction-curves", "friction.yaml"))):
            patch.setattr("sys.argv", ["excite", "identify", "irp6", "run.csv", *more, "--out", name])
            with pytest.raises(SystemExit) as ended:
                main()
            assert ended.value.code == 0
    return folder


@pytest.fixture
def here(files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Here:
    link_files(files, tmp_path)
    for name in ("result", "masses"):
        (tmp_path / name).unlink()
        shutil.copytree(files / name, tmp_path / name)
    monkeypatch.setattr(figures, "write_figures", lambda *_, **__: [])
    return Here(tmp_path, monkeypatch, capfd)


def changed(here: Here, change: Callable[[dict[str, Any]], object], name: str = "result") -> None:
    """Change what a result's file says."""
    path = here.cwd / name / "result.json"
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
    path.with_name("manifest.json").unlink(missing_ok=True)


def heavier(content: dict[str, Any]) -> None:
    content["fit"] = [1.3 * (fit or 0.0) for fit in content["fit"] or content["values"]]


# ---------------------------------------------------------------- verdicts


def test_a_good_result_is_believed(here: Here, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(figures, "write_figures", DRAW)
    ended = here.run("verify", "result", "again.csv", "-v", status=0, stderr="")
    written = files_below(here.cwd / "result") - {"result.json", "curves.npz", "manifest.json"}
    endings = (".json", "_curves.npz", "_torques.png", "_motion.png")
    assert written == {f"verification-again{x}" for x in endings}
    content = json.loads((here.cwd / "result" / "verification-again.json").read_text())
    stated = [content[name] for name in ("schema", "holds", "against")]
    assert stated == ["excite.verification/2", True, []]
    assert (content["robot"]["name"], content["robot"]["sha256"]) == ("irp6", built_in("irp6").sha256())
    assert content["log"]["sha256"] == sha256((here.cwd / "again.csv").read_bytes()).hexdigest()
    assert content["tolerances"] == {"torque": 0.1, "motion": 0.25}
    result = json.loads((here.cwd / "result" / "result.json").read_text())
    assert content["training_error"] == result["prediction_error"]
    assert content["relative_error"] == pytest.approx(result["prediction_error"], rel=0.3)
    assert [error["name"] for error in content["torques"]] == ["q1", "q2", "q3"]
    for text in (
        "again.csv: 401 rows; predicted torques miss ",
        "% where identified)",
        "Predicted against measured",
        "Simulated against measured motion",
        "The result predicts this log: you can rely on it for motions of this kind.",
        "written to result: ",
    ):
        assert text in ended.stdout


def test_a_wrong_result_is_not_and_tolerances_are_percents(here: Here) -> None:
    changed(here, heavier)
    ended = here.run("verify", "result", "again.csv", status=1, stderr="")
    assert "Do not rely on the result: predictions miss 30" in ended.stdout
    content = json.loads((here.cwd / "result" / "verification-again.json").read_text())
    assert content["holds"] is False
    assert len(content["against"]) >= 2
    for tolerances, status in (("--torque-tolerance 61 --motion-tolerance 900", 0), ("--torque-tolerance 29", 1)):
        assert here.run("verify", "result", "again.csv", *tolerances.split()).returncode == status


def test_every_log_counts(here: Here) -> None:
    (here.cwd / "sub").mkdir()
    log = read_log(here.cwd / "other.csv")
    object.__setattr__(log, "effort", 1.5 * log.effort)
    write_log(log, here.cwd / "sub" / "again.csv")
    ended = here.run("verify", "result", "again.csv", "sub/again.csv", "--json", "--out", "judged/both", status=1)
    assert [content["holds"] for content in json.loads(ended.stdout)] == [True, False]
    names = {f"verification-again{x}" for x in (".json", "_curves.npz", "-2.json", "-2_curves.npz")} | {"manifest.json"}
    assert files_below(here.cwd / "judged" / "both") == names
    second = json.loads((here.cwd / "judged" / "both" / "verification-again-2.json").read_text())
    assert second["log"]["file"] == "sub/again.csv"


def test_known_friction_is_remembered_by_the_result(here: Here) -> None:
    (here.cwd / "friction.yaml").unlink()
    here.run("verify", "masses", "again.csv", status=0, stderr="")


def test_a_training_log_is_refused_unless_allowed(here: Here) -> None:
    shutil.copy(here.cwd / "run.csv", here.cwd / "renamed.csv")
    refused(here, "renamed.csv is a log that the result was identified from: ", "result", "renamed.csv")
    assert here.run("verify", "result", "renamed.csv", "--training-too").returncode == 0


# ---------------------------------------------------------------- what is refused


def refused(here: Here, message: str, *arguments: str) -> None:
    assert message in here.refused("verify", *arguments)


BAD = (
    ("nothing again.csv", "nothing holds no result: there is no nothing/result.json; write one with 'excite identify'"),
    ("result", "Missing argument 'LOG...'"),
    ("result again.csv nothing.csv --out new", "cannot read log nothing.csv: No such file or directory"),
    ("result again.csv --out run.csv", "cannot write to run.csv: it is a file, not a folder"),
    ("result again.csv --rows 1:999", "again.csv: rows: given 1:999, but the log has 401 rows"),
    ("result again.csv --rows 9:3", "rows: the first must be 1 or more and below the last, given '9:3'"),
)


def test_bad_input_is_refused_in_one_line(here: Here) -> None:
    for arguments, message in BAD:
        refused(here, message, *arguments.split())


def test_a_folder_needs_a_name_and_a_log_its_robot(here: Here) -> None:
    refused(here, "expected the name of a folder, given ''", "", "again.csv")
    refused(here, "expected the name of a folder, given ''", "result", "again.csv", "--out", "")
    write_sidecar(here.cwd / "again.csv", built_in("panda"))
    refused(here, "again.csv is a log of panda (description ", "result", "again.csv")


DAMAGED: tuple[tuple[Callable[[dict[str, Any]], object], str], ...] = (
    (lambda c: c.update(schema="excite.result/9"), "expected schema excite.result/2, given 'excite.result/9'"),
    (lambda c: c.pop("prediction_error"), "not a complete result: 'prediction_error' is missing"),
    (lambda c: c.update(task=[]), "not a complete result: "),
    (lambda c: c["robot"]["description"].update(gravity=[0.0] * 3), "does not have the hash that the file states"),
    (lambda c: c["robot"].update(description=4), "not a robot description"),
    (lambda c: c.update(fit=["nan", *c["values"][1:]]), "not a complete result: expected finite numbers"),
    (lambda c: c.update(fit=[math.nan, *c["values"][1:]]), "result.json: NaN is not a finite number"),
    (lambda c: c["values"].pop(), "not a complete result: parameters without a name"),
    (lambda c: c.update(friction={"file": "f", "sha256": ""}), "not a complete result: 'text' is missing"),
    (lambda c: c.update(friction={"file": "f.yaml", "text": "a"}), "f.yaml: expected a mapping of fields, given 'a'"),
)


def test_a_damaged_result_is_refused(here: Here) -> None:
    whole = (here.cwd / "result" / "result.json").read_text()
    for damage, message in DAMAGED:
        (here.cwd / "result" / "result.json").write_text(whole)
        changed(here, damage)
        refused(here, message, "result", "again.csv")


def test_what_is_no_json_is_refused_with_its_line(here: Here) -> None:
    path = here.cwd / "result" / "result.json"
    path.write_text(path.read_text()[:2000])
    refused(here, "result/result.json is not JSON (line ", "result", "again.csv")
