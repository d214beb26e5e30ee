"""Readers beside a writer: they see the files of one run, wait for one that puts files in place, or say the remedy."""

from __future__ import annotations

import json
import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from written_results import simulation

import excite
from excite.design.optimisation import design_trajectory
from excite.design.start_results import read_start, start_file
from excite.export.models.robot_yaml import write_robot
from excite.identification.given_logs import log_of
from excite.storage import commit as committing
from excite.storage.atomic import Destination
from excite.storage.commit import read_settled
from excite.storage.lock import locked, write_holder
from excite.storage.manifest import check_files, read_manifest
from excite.storage.result_folder import replace_result, result_folder
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.readers.library import built_in

COLUMNS = ("a.json", "b.json")
TASK = Task("irp6", joints=("1",), torque_margin=None, harmonics=3, starts=1, executor="serial", rate=20.0)


def write(folder: Path, version: int) -> None:
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
    write(tmp_path, 1)
    calls = []

    def disturbed() -> set[str]:
        calls.append(0)
        found = {(tmp_path / name).read_text() for name in COLUMNS[:before]}
        if len(calls) == 1:
            write(tmp_path, 2)
        found |= {(tmp_path / name).read_text() for name in COLUMNS[before:]}
        check_files(tmp_path, "x", COLUMNS)
        return found

    assert read_settled(Destination(tmp_path), disturbed) == {"2"}
    assert len(calls) == 2


def test_files_that_were_changed_are_refused_at_once(tmp_path: Path) -> None:
    write(tmp_path, 1)
    (tmp_path / "b.json").write_text("3")
    began = time.monotonic()
    with pytest.raises(InputError, match=r"b\.json has been changed"):
        read_settled(Destination(tmp_path), lambda: read(tmp_path))
    assert time.monotonic() - began < committing.PATIENCE / 2


def slow_commit(folder: Path, begun: threading.Event, monkeypatch: pytest.MonkeyPatch) -> threading.Thread:
    """A writer that stops for a while after its first file is in place."""
    replace = os.replace

    def slowly(source: Path, target: Path) -> None:
        replace(source, target)
        if Path(target) == folder / "a.json":
            begun.set()
            time.sleep(0.2)

    monkeypatch.setattr("excite.storage.commit.os.replace", slowly)
    return threading.Thread(target=write, args=(folder, 2))


def test_a_reader_waits_for_a_commit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path, 1)
    begun = threading.Event()
    writer = slow_commit(tmp_path, begun, monkeypatch)
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
    write(tmp_path, 1)

    def stop(_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(committing, "_finish", stop)
        with pytest.raises(KeyboardInterrupt):
            write(tmp_path, 2)
    assert (tmp_path / ".commit" / "a.json").exists()
    return tmp_path


@pytest.fixture
def read_only(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    def refused(at: Destination) -> Iterator[None]:
        raise InputError(f"cannot write {at.path}: Permission denied")

    with monkeypatch.context() as patch:
        patch.setattr(committing, "locked", refused)
        yield


def test_files_to_be_put_in_place_by_another_user(pending: Path, read_only: None) -> None:
    began = time.monotonic()
    with pytest.raises(InputError, match=r"Permission denied; .*: read .* once as a user who may write there, or read"):
        read_settled(Destination(pending), lambda: read(pending))
    assert time.monotonic() - began < committing.PATIENCE / 2


def test_the_remedy_helps(pending: Path) -> None:
    assert read_settled(Destination(pending), lambda: read(pending)) == {"2"}


def test_a_commit_of_another_user_is_waited_for(pending: Path, read_only: None) -> None:
    write_holder(pending / ".writer.json")  # this process, which runs
    timer = threading.Timer(0.1, lambda: committing._finish(Destination(pending)))
    timer.start()
    assert read_settled(Destination(pending), lambda: read(pending)) == {"2"}
    timer.join()


# ---------------------------------------------------------------- locks


def test_a_robot_that_is_being_written(tmp_path: Path) -> None:
    path, refused = tmp_path / "arm.yaml", []

    def second() -> None:
        try:
            write_robot(built_in("irp6"), path)
        except InputError as error:
            refused.append(str(error))

    with locked(Destination(tmp_path, path.name)):
        thread = threading.Thread(target=second)
        thread.start()
        thread.join()
        assert not path.exists()
    assert "is being written by process" in refused[0]
    write_robot(built_in("irp6"), path)
    assert [each.name for each in tmp_path.iterdir()] == ["arm.yaml"]


# ---------------------------------------------------------------- one run


def test_starts_design_and_manifest_state_one_run(tmp_path: Path) -> None:
    runs = []
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        made = design_trajectory(TASK, folder=tmp_path / name)
        made.save(tmp_path / name / "saved")
        origin = read_start(start_file(tmp_path / name, 0))[1]
        assert origin is not None
        assert origin.run == made.provenance["run"] == read_manifest(tmp_path / name / "saved")["design"].run
        runs.append(origin.run)
    assert runs[0] != runs[1]


def test_the_folder_of_starts_is_locked(tmp_path: Path) -> None:
    refused: list[str] = []

    def second() -> None:
        try:
            design_trajectory(TASK, folder=tmp_path)
        except InputError as error:
            refused.append(str(error))

    def during(_: object) -> None:
        if not refused:
            thread = threading.Thread(target=second)
            thread.start()
            thread.join()

    design_trajectory(TASK, folder=tmp_path, progress=during)
    assert len(refused) == 1
    assert "is being written by process" in refused[0]


# ---------------------------------------------------------------- logs and what is beside them


def test_what_is_beside_an_edited_log_is_ignored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run, path = simulation("old"), tmp_path / "run.csv"
    run.save(path)
    robot = built_in("irp6")
    whole = log_of(path, robot)
    assert whole.truth == run.truth
    assert whole.left_out == ()
    path.write_text(path.read_text().replace("\n", " \n", 1))
    edited = log_of(path, robot)
    assert edited.truth is None
    assert edited.left_out == ("run.json beside it is ignored, since the log was changed after that file was written",)
    content = json.loads((tmp_path / "run.json").read_text())
    del content["log"]  # as in a file of before
    (tmp_path / "run.json").write_text(json.dumps(content))
    assert log_of(path, robot).truth == run.truth


def test_a_log_and_what_is_beside_it_are_of_one_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, reading = tmp_path / "run.csv", []
    simulation("old").save(path)
    known = excite.identification.given_logs.read_log

    def disturbed(*given: object) -> excite.Log:
        log = known(*given)  # type: ignore[arg-type]
        if not reading:
            simulation("new").save(path, replace=True)
        reading.append(log)
        return log

    monkeypatch.setattr("excite.identification.given_logs.read_log", disturbed)
    assert log_of(path, built_in("irp6")).truth is not None
    assert len(reading) == 2


@pytest.mark.parametrize("entry", ["1", "{}", '{"sha256": 1}', "null"])
def test_a_hash_that_is_none(entry: str, tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    simulation("old").save(path)
    content = {**json.loads((tmp_path / "run.json").read_text()), "log": json.loads(entry)}
    (tmp_path / "run.json").write_text(json.dumps(content))
    with pytest.raises(InputError, match=r"run\.json: log should have a sha256"):
        log_of(path, built_in("irp6"))
