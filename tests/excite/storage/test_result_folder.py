"""One writer of a folder, files that belong together, files of the user's own, and readers beside a writer."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from commands import ENVIRONMENT, Here, files_below
from filelock import FileLock
from refused import refusal
from written_files import saved
from written_results import COMMANDS, design, simulation

import excite
from excite.design.optimisation import design_trajectory
from excite.design.start_results import read_start, start_file
from excite.export.models.robot_yaml import write_robot
from excite.identification.procedure import log_of
from excite.storage import commit as committing
from excite.storage.atomic import MANIFEST, Destination, shown, write_json
from excite.storage.commit import locked, read_settled, settle, write_holder
from excite.storage.manifest import FileHash, check_files, read_manifest
from excite.storage.result_folder import amend_result, replace_result, result_folder
from excite.tasks.task import Task
from regressors.errors import InputError, NumericalError, TakenError
from regressors.readers.library import built_in

# One writer of a folder, files that belong together, and files of the user's own that stay.


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


def test_a_note_of_the_holder_that_says_nothing(tmp_path: Path) -> None:
    with FileLock(tmp_path / ".lock"):
        for content in ("", "[]", '{"process": "1"}', '{"process": 99999999, "host": 1}'):
            (tmp_path / ".writer.json").write_text(content)
            another = pytest.raises(InputError, match="is being written by another process; wait for it")
            with another, result_folder(tmp_path):
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


def test_folders_of_a_result_are_not_listed(tmp_path: Path) -> None:
    (tmp_path / "starts").mkdir()
    (tmp_path / "starts" / "1.json").write_text("1")
    with result_folder(tmp_path), replace_result(tmp_path, "x", folders=("starts",)) as staged:
        write_json(staged / "a.json", 1)
    assert set(read_manifest(tmp_path)["x"].files) == {"a.json"}
    assert files_below(tmp_path / "starts") == {"1.json"}


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


OF_X = '{"schema": "excite.manifest/1", "results": {"x": {"run": "1", "files": %s}}}'


def test_a_damaged_manifest_is_refused(tmp_path: Path) -> None:
    for content in (
        "{",
        '{"schema": "excite.manifest/2"}',
        '{"schema": "excite.manifest/1"}',
        '{"schema": "excite.manifest/1", "results": []}',
        OF_X % '{"../a": {"sha256": "", "size": 1}}',
        OF_X % '{"a": {"sha256": ""}}',
        OF_X % '{}, "figures": 1',
    ):
        (tmp_path / MANIFEST).write_text(content)
        assert MANIFEST in refusal(read_manifest, tmp_path)


@pytest.mark.parametrize("name", ["../mine", "/etc/mine", "..", "", "a\\b", 3])
def test_a_journal_cannot_reach_out_of_its_folder(name: object, tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("mine")
    commit = tmp_path / "out" / ".commit"
    commit.mkdir(parents=True)
    for key in ("files", "remove", "folders"):
        (commit / ".journal").write_text(json.dumps({key: [name]}))
        assert "names of files without a folder" in refusal(settle, Destination(tmp_path / "out"))
    assert (tmp_path / "mine").read_text() == "mine"


def test_messages_name_what_was_asked_for() -> None:
    known = {
        "out/.staging/design.json": "out/design.json",
        "out/.next/starts/start-0000.json": "out/starts/start-0000.json",
        "out/.lock": "out",
        "logs/.run.csv.staging/run.json": "logs/run.json",
        "logs/.run.csv.staging": "logs/run.csv",
        "logs/.run.csv.writer.json": "logs/run.csv",
        "/home/.config/design.json": "/home/.config/design.json",
    }
    assert {path: str(shown(Path(path))) for path in known} == known


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
    excite.load_design(saved(folder, design("old")))
    change(folder, name)
    assert re.search(text, refusal(excite.load_design, folder))
    (folder / MANIFEST).unlink()  # as in a folder of before
    if text == SINCE:
        excite.load_design(folder)


def test_a_rehearsal_that_was_changed_is_not_played(tmp_path: Path) -> None:
    stored = excite.load_design(saved(tmp_path, design("old")))
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
    excite.load_design(saved(tmp_path, design("old"), replace=True))


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


# Readers beside a writer: they see the files of one run, wait for one that puts files in place, or say the remedy.


COLUMNS = ("a.json", "b.json")
TASK = Task("irp6", joints=("1",), torque_margin=None, harmonics=3, starts=1, executor="serial", rate=20.0)


def write_both(folder: Path, version: int) -> None:
    with result_folder(folder), replace_result(folder, "x") as staged:
        for name in COLUMNS:
            (staged / name).write_text(str(version))


def read(folder: Path) -> set[str]:
    found = {(folder / name).read_text() for name in COLUMNS}
    check_files(folder, "x", COLUMNS)
    return found


# ---------------------------------------------------------------- a commit while files are read


@pytest.mark.parametrize("before", [0, 1], ids=["before the first file", "between files"])
def test_a_commit_between_two_reads_is_noticed(before: int, tmp_path: Path) -> None:
    write_both(tmp_path, 1)
    calls = []

    def disturbed() -> set[str]:
        calls.append(0)
        found = {(tmp_path / name).read_text() for name in COLUMNS[:before]}
        if len(calls) == 1:
            write_both(tmp_path, 2)
        found |= {(tmp_path / name).read_text() for name in COLUMNS[before:]}
        check_files(tmp_path, "x", COLUMNS)
        return found

    assert read_settled(Destination(tmp_path), disturbed) == {"2"}
    assert len(calls) == 2


def test_files_that_were_changed_are_refused_at_once(tmp_path: Path) -> None:
    write_both(tmp_path, 1)
    (tmp_path / "b.json").write_text("3")
    began = time.monotonic()
    assert "b.json has been changed" in refusal(read_settled, Destination(tmp_path), lambda: read(tmp_path))
    assert time.monotonic() - began < committing.PATIENCE / 2


def test_a_reader_waits_for_a_commit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a writer that stops for a while after its first file is in place."""
    write_both(tmp_path, 1)
    begun, replace = threading.Event(), os.replace

    def slowly(source: Path, target: Path) -> None:
        replace(source, target)
        if Path(target) == tmp_path / "a.json":
            begun.set()
            time.sleep(0.2)

    monkeypatch.setattr("excite.storage.commit.os.replace", slowly)
    writer = threading.Thread(target=write_both, args=(tmp_path, 2))
    writer.start()
    assert begun.wait(10)
    with pytest.raises(InputError, match="been changed"):
        read(tmp_path)  # as one without the wait sees it
    assert read_settled(Destination(tmp_path), lambda: read(tmp_path)) == {"2"}
    writer.join()


# ---------------------------------------------------------------- folders that may not be written to


@pytest.fixture
def pending(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with files that a killed run has left to be put in place, and which this process may not write to."""
    write_both(tmp_path, 1)

    def stop(_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(committing, "_finish", stop)
        with pytest.raises(KeyboardInterrupt):
            write_both(tmp_path, 2)
    assert (tmp_path / ".commit" / "a.json").exists()
    return tmp_path


def unwritable(at: Destination) -> Iterator[None]:
    raise InputError(f"cannot write {at.path}: Permission denied")


def test_files_to_be_put_in_place_by_another_user_and_the_remedy(
    pending: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    began, message = time.monotonic(), r"Permission denied; .*: read .* once as a user who may write there, or read"
    with monkeypatch.context() as patch:
        patch.setattr(committing, "locked", unwritable)
        assert re.search(message, refusal(read_settled, Destination(pending), lambda: read(pending)))
    assert time.monotonic() - began < committing.PATIENCE / 2
    assert read_settled(Destination(pending), lambda: read(pending)) == {"2"}


def test_a_commit_of_another_user_is_waited_for(pending: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(committing, "locked", unwritable)
    write_holder(pending / ".writer.json")  # this process, which runs
    timer = threading.Timer(0.1, lambda: committing._finish(Destination(pending)))
    timer.start()
    assert read_settled(Destination(pending), lambda: read(pending)) == {"2"}
    timer.join()


# ---------------------------------------------------------------- locks


def refused_meanwhile(work: Callable[[], object]) -> str:
    """What a second thread is told that does the same work."""
    refused: list[str] = []

    def second() -> None:
        try:
            work()
        except InputError as error:
            refused.append(str(error))

    thread = threading.Thread(target=second)
    thread.start()
    thread.join()
    return refused[0]


def test_a_robot_that_is_being_written(tmp_path: Path) -> None:
    path = tmp_path / "arm.yaml"
    with locked(Destination(tmp_path, path.name)):
        refused = refused_meanwhile(lambda: write_robot(built_in("irp6"), path))
        assert not path.exists()
    assert "is being written by process" in refused
    write_robot(built_in("irp6"), path)
    assert [each.name for each in tmp_path.iterdir()] == ["arm.yaml"]


# ---------------------------------------------------------------- one run


def test_starts_design_and_manifest_state_one_run_that_locks_the_starts(tmp_path: Path) -> None:
    runs, refused = set(), list[str]()

    def during(_: object) -> None:
        refused.append(refused_meanwhile(lambda: design_trajectory(TASK, folder=folder)))

    for name in ("first", "second"):
        (folder := tmp_path / name).mkdir()
        made = design_trajectory(TASK, folder=folder, progress=during)
        assert "is being written by process" in refused[-1]
        made.save(folder / "saved")
        origin = read_start(start_file(folder, 0))[1]
        assert origin["run"] == made.provenance["run"] == read_manifest(folder / "saved")["design"].run
        runs.add(origin["run"])
    assert len(runs) == 2


# ---------------------------------------------------------------- logs and what is beside them


def test_what_is_beside_an_edited_log_is_ignored(tmp_path: Path) -> None:
    run, path = simulation("old"), tmp_path / "run.csv"
    run.save(path)
    robot = built_in("irp6")
    whole = log_of(path, robot)
    assert (whole.truth, whole.left_out) == (run.truth, ())
    path.write_text(path.read_text().replace("\n", " \n", 1))
    edited = log_of(path, robot)
    assert edited.truth is None
    assert edited.left_out == ("run.json beside it is ignored, since the log was changed after that file was written",)
    content = json.loads((tmp_path / "run.json").read_text())
    del content["log"]  # as in a file of before
    (tmp_path / "run.json").write_text(json.dumps(content))
    assert log_of(path, robot).truth == run.truth
    for entry in (1, {}, {"sha256": 1}, None):
        (tmp_path / "run.json").write_text(json.dumps({**content, "log": entry}))
        assert "run.json: log should have a sha256" in refusal(log_of, path, robot)


def test_a_log_and_what_is_beside_it_are_of_one_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, reading = tmp_path / "run.csv", []
    simulation("old").save(path)
    known = excite.identification.procedure.read_log

    def disturbed(*given: object) -> excite.Log:
        log = known(*given)  # type: ignore[arg-type]
        if not reading:
            simulation("new").save(path, replace=True)
        reading.append(log)
        return log

    monkeypatch.setattr("excite.identification.procedure.read_log", disturbed)
    assert log_of(path, built_in("irp6")).truth is not None
    assert len(reading) == 2
