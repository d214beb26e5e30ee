"""One writer of a folder, files that belong together, and files of the user's own that stay."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from commands import ENVIRONMENT, Here, files_below
from written_results import COMMANDS, design, simulation

import excite
from excite.storage.atomic import MANIFEST, Destination, shown, write_json
from excite.storage.commit import settle
from excite.storage.manifest import Entry, FileHash, read_manifest
from excite.storage.result_folder import amend_result, replace_result, result_folder
from regressors.errors import InputError, NumericalError, TakenError

HOLD = """
import sys, time
from pathlib import Path
from excite.storage.result_folder import result_folder
with result_folder(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


def write(folder: Path, kind: str, **files: str) -> None:
    with result_folder(folder), replace_result(folder, kind) as staged:
        for name, content in files.items():
            write_json(staged / name.replace("_", "."), content)


# ---------------------------------------------------------------- one writer


def test_a_second_process_is_refused_and_told_the_holder(here: Here) -> None:
    tmp_path = here.cwd
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLD, "out"], cwd=tmp_path, stdout=subprocess.PIPE, env=ENVIRONMENT, text=True
    )
    assert holder.stdout is not None
    second = ("friction", "plan", "irp6", "--drives", "z5", "--warm-up", "0", "--speeds", "20,100", "--breakaways", "0")
    try:
        assert holder.stdout.readline() == "held\n"
        refused = here.run(*second, "--rate", "50", "--out", "out")
        assert (refused.returncode, refused.stdout) == (2, "")
        assert f"excite: out is being written by process {holder.pid} on " in refused.stderr
        assert refused.stderr.endswith("; wait for it, or choose another --out\n")
        assert len(refused.stderr.splitlines()) == 1
    finally:
        holder.send_signal(signal.SIGKILL)
        holder.wait()
        holder.stdout.close()
    assert files_below(tmp_path / "out") == {".lock", ".writer.json"}
    with result_folder(tmp_path / "out"):
        assert json.loads((tmp_path / "out" / ".writer.json").read_text())["process"] == os.getpid()
    assert files_below(tmp_path / "out") == set()


def test_a_block_in_a_block_has_the_lock_already(tmp_path: Path) -> None:
    folder = tmp_path / "a" / "b"
    with result_folder(folder), result_folder(folder):
        write(folder, "x", a_json="1")
        assert (folder / ".lock").exists()
    assert files_below(folder) == {"a.json", MANIFEST}


@pytest.mark.parametrize("content", ["", "[]", '{"process": "1"}', '{"process": 99999999, "host": 1}'])
def test_a_note_of_the_holder_that_says_nothing(content: str, tmp_path: Path) -> None:
    from filelock import FileLock

    with FileLock(tmp_path / ".lock"):
        (tmp_path / ".writer.json").write_text(content)
        with (
            pytest.raises(InputError, match="is being written by another process; wait for it"),
            result_folder(tmp_path),
        ):
            pass


# ---------------------------------------------------------------- several results in a folder


def test_each_result_owns_its_files(tmp_path: Path) -> None:
    write(tmp_path, "x", a_json="1", b_json="2")
    write(tmp_path, "y", c_json="3")
    with result_folder(tmp_path), amend_result(tmp_path, "x") as staged:
        (staged / "x.png").write_bytes(b"x")
    assert {kind: set(entry.files) for kind, entry in read_manifest(tmp_path).items()} == {
        "x": {"a.json", "b.json", "x.png"},
        "y": {"c.json"},
    }
    (tmp_path / "mine").write_text("mine")
    write(tmp_path, "x", a_json="4")
    assert files_below(tmp_path) == {"a.json", "c.json", "mine", MANIFEST}


def test_many_files_of_a_folder_have_one_hash(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("excite.storage.result_folder.LISTED", 3)
    starts = tmp_path / "starts"
    starts.mkdir()

    def entry_of(contents: dict[str, str]) -> Entry:
        for name in files_below(starts):
            (starts / name).unlink()
        for name, content in contents.items():
            (starts / name).write_text(content)
        with result_folder(tmp_path), replace_result(tmp_path, "x", folders=("starts",)) as staged:
            write_json(staged / "a.json", 1)
        return read_manifest(tmp_path)["x"]

    three = {"1.json": "1", "2.json": "2", "3.json": "3", ".hidden": ""}
    listed = entry_of(three)
    assert set(listed.files) == {"a.json", "starts/1.json", "starts/2.json", "starts/3.json"}
    assert listed.folders == {}
    assert "folders" not in (tmp_path / MANIFEST).read_text()
    four = {**three, "4.json": "4"}
    many = entry_of(four)
    assert set(many.files) == {"a.json"}
    assert many.folders["starts"].count == 4
    assert entry_of(dict(reversed(four.items()))).folders == many.folders
    for other in ({**four, "4.json": "5"}, {**three, "5.json": "4"}, {**four, "1.json": "2", "2.json": "1"}):
        assert entry_of(other).folders != many.folders
    with result_folder(tmp_path), amend_result(tmp_path, "x") as staged:
        (staged / "x.png").write_bytes(b"x")
    assert read_manifest(tmp_path)["x"].folders != {}


def test_an_error_leaves_the_old_result(tmp_path: Path) -> None:
    write(tmp_path, "x", a_json="1")
    with pytest.raises(NumericalError, match=r"b\.json is not written: it is not finite"):
        write(tmp_path, "x", a_json="2", b_json=float("nan"))  # type: ignore[arg-type]
    assert json.loads((tmp_path / "a.json").read_text()) == "1"
    assert files_below(tmp_path) == {"a.json", MANIFEST}


def test_a_manifest_of_the_users_own_stays(tmp_path: Path) -> None:
    (tmp_path / MANIFEST).write_text('{"name": "my web page"}')
    write(tmp_path, "x", a_json="1")
    assert json.loads((tmp_path / MANIFEST).read_text()) == {"name": "my web page"}
    assert read_manifest(tmp_path) == {}


@pytest.mark.parametrize(
    "content",
    [
        "{",
        '{"schema": "excite.manifest/2"}',
        '{"schema": "excite.manifest/1"}',
        '{"schema": "excite.manifest/1", "results": []}',
        '{"schema": "excite.manifest/1", "results": {"x": {"run": "1", "files": {"../a": {"sha256": "", "size": 1}}}}}',
        '{"schema": "excite.manifest/1", "results": {"x": {"run": "1", "files": {"a": {"sha256": ""}}}}}',
        '{"schema": "excite.manifest/1", "results": {"x": {"run": "1", "files": {}, "folders": {"a": {"sum": ""}}}}}',
        '{"schema": "excite.manifest/1", "results": {"x": {"run": "1", "files": {}, "folders": []}}}',
    ],
)
def test_a_damaged_manifest_is_refused(content: str, tmp_path: Path) -> None:
    (tmp_path / MANIFEST).write_text(content)
    with pytest.raises(InputError, match=MANIFEST):
        read_manifest(tmp_path)


@pytest.mark.parametrize("name", ["../mine", "/etc/mine", "..", "", "a\\b", 3])
def test_a_journal_cannot_reach_out_of_its_folder(name: object, tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("mine")
    commit = tmp_path / "out" / ".commit"
    commit.mkdir(parents=True)
    for key in ("files", "remove", "folders"):
        (commit / ".journal").write_text(json.dumps({key: [name]}))
        with pytest.raises(InputError, match="names of files without a folder"):
            settle(Destination(tmp_path / "out"))
    assert (tmp_path / "mine").read_text() == "mine"


@pytest.mark.parametrize(
    ("path", "known"),
    [
        ("out/.staging/design.json", "out/design.json"),
        ("out/.next/starts/start-0000.json", "out/starts/start-0000.json"),
        ("out/.lock", "out"),
        ("logs/.run.csv.staging/run.json", "logs/run.json"),
        ("logs/.run.csv.staging", "logs/run.csv"),
        ("logs/.run.csv.writer.json", "logs/run.csv"),
        ("/home/.config/design.json", "/home/.config/design.json"),
    ],
)
def test_messages_name_what_was_asked_for(path: str, known: str) -> None:
    assert shown(Path(path)) == Path(known)


# ---------------------------------------------------------------- readers and the user's own files


def edit(folder: Path, name: str) -> None:
    text = (folder / name).read_text()
    date = '"date": "' if name == "design.json" else ""
    place = text.index(date) + len(date) if date else text.rindex("1")
    (folder / name).write_text(f"{text[:place]}3{text[place + 1 :]}")


def swap(folder: Path, name: str) -> None:
    other = folder.with_name("other")
    if not other.exists():
        design("new").save(other)
    os.replace(other / name, folder / name)


BESIDE = r"trajectory\.csv beside it was changed after the design was written"
SINCE = r"design\.json has been changed since manifest\.json was written, or comes from another run"


@pytest.mark.parametrize(
    ("name", "change", "text"),
    [
        ("trajectory.csv", edit, BESIDE),
        ("trajectory.csv", swap, BESIDE),
        ("design.json", swap, BESIDE),
        ("design.json", edit, SINCE),
    ],
)
def test_files_that_do_not_belong_together_are_named(
    name: str, change: Callable[[Path, str], None], text: str, tmp_path: Path
) -> None:
    folder = tmp_path / "out"
    design("old").save(folder)
    excite.load_design(folder)
    change(folder, name)
    with pytest.raises(InputError, match=text):
        excite.load_design(folder)
    (folder / MANIFEST).unlink()  # as in a folder of before
    if text == SINCE:
        excite.load_design(folder)


def test_a_rehearsal_that_was_changed_is_not_played(tmp_path: Path) -> None:
    design("old").save(tmp_path)
    stored = excite.load_design(tmp_path)
    edit(tmp_path, "trajectory-0.5.csv")
    with pytest.raises(InputError, match=r"trajectory-0\.5\.csv has been changed since design.json was written"):
        excite.simulate(stored, trajectory=tmp_path / "trajectory-0.5.csv")


def test_figures_do_not_matter_to_readers(tmp_path: Path) -> None:
    design("old").save(tmp_path)
    with result_folder(tmp_path), amend_result(tmp_path, "design") as staged:
        (staged / "motion.png").write_bytes(b"motion")
    (tmp_path / "motion.png").write_bytes(b"painted over")
    excite.load_design(tmp_path)
    (tmp_path / "motion.png").unlink()
    excite.load_design(tmp_path)


def test_a_design_of_before_is_replaced_whole(tmp_path: Path) -> None:
    design("old").save(tmp_path)
    (tmp_path / MANIFEST).unlink()
    (tmp_path / "workspace.png").write_bytes(b"of the old design")
    (tmp_path / "notes.txt").write_text("mine")
    design("new").save(tmp_path, replace=True)
    data = {"design.json", "trajectory.csv", "trajectory-0.25.csv", "trajectory-0.75.csv", MANIFEST, "notes.txt"}
    assert files_below(tmp_path) == {*data, "starts", "starts/start-0000.json"}


def test_a_trajectory_of_the_users_own_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "trajectory.csv").write_text("mine")
    with pytest.raises(TakenError, match=r"trajectory\.csv is already there, and is not of a design; `replace`"):
        design("old").save(tmp_path)
    assert files_below(tmp_path) == {"trajectory.csv"}
    design("old").save(tmp_path, replace=True)
    excite.load_design(tmp_path)


def test_a_verification_does_not_overwrite_another_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "verification-run.json").write_text("{}")
    monkeypatch.setattr("excite.verify", None)
    assert COMMANDS["verify"].run(tmp_path, "old", monkeypatch, force=False) == 2
    assert (tmp_path / "out" / "verification-run.json").read_text() == "{}"


def test_a_run_without_a_load_replaces_one_with_a_load(tmp_path: Path) -> None:
    run = simulation("old")
    run.save(tmp_path / "run.csv")
    for name, of in (("run.wrench.csv", "run.csv"), ("run.wrench.json", "run.json")):
        (tmp_path / name).write_bytes((tmp_path / of).read_bytes())
    of_wrench = json.loads((tmp_path / "run.wrench.json").read_text())
    assert of_wrench["log"]["sha256"] == FileHash.of(tmp_path / "run.csv").sha256
    write_json(tmp_path / "run.wrench.json", {**of_wrench, "log": {"sha256": "of the wrench"}})
    run.save(tmp_path / "run.csv", replace=True)
    assert files_below(tmp_path) == {"run.csv", "run.json"}
