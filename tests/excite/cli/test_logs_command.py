"""``excite logs``: what it shows, the mapping that it writes, and that other commands take it as it stands."""

from __future__ import annotations

import json

import numpy as np
import pytest
from commands import Here
from foreign_logs import motion, write_plotjuggler, write_rtde, write_table
from value_fuzzer import ROBOT

import excite


def test_currents_are_asked_for_and_the_mapping_reads_the_log(here: Here) -> None:
    moved = motion(6)
    write_rtde(here.cwd / "run", moved, torque="target_moment")
    ended = here.run("logs", "run", "--robot", "ur10e", "--write-mapping", "map.yaml")
    assert ended.returncode == 0, ended.stderr
    assert "Universal Robots RTDE recording" in ended.stdout
    assert "600 rows at 100 Hz over 5.99 s by timestamp, no gaps" in ended.stdout
    assert "Positions [rad] are actual_q_0 ... actual_q_5, of 6 joints" in ended.stdout
    text = (here.cwd / "map.yaml").read_text(encoding="utf-8")
    assert "# QUESTION: What is the gain of each motor current" in text
    log = excite.read_log(here.cwd / "run", mapping=excite.read_mapping(here.cwd / "map.yaml"), robot=_ur10e())
    np.testing.assert_array_equal(log.effort, moved.tau / 10.0)  # the gain 1 stands for what was asked


def _ur10e() -> excite.Robot:
    return excite.load_robot("ur10e")


@pytest.mark.slow
def test_identify_and_verify_take_the_mapping_as_it_stands(here: Here) -> None:
    """Of a log in degrees, milliseconds and tabs; the questions that remain are answered rightly by the guess."""
    (here.cwd / "two.yaml").write_text(ROBOT, encoding="utf-8")
    moved = motion(2, rate=200.0, seconds=10.0)
    rows = np.column_stack([1e3 * moved.time, np.rad2deg(moved.q), np.rad2deg(moved.dq), moved.tau]).tolist()
    names = [f"{name}{k}" for name in ("pos", "vel", "torque") for k in (1, 2)]
    write_table(here.cwd / "run.txt", ["t", *names], rows, "\t")
    assert here.run("logs", "run.txt", "--robot", "two.yaml", "--write-mapping", "map.yaml").returncode == 0
    arguments = ("run.txt", "--mapping", "map.yaml")
    ended = here.run("identify", "two.yaml", *arguments, "--choose", "none", "--out", "r")
    assert ended.returncode in (0, 1), ended.stderr
    assert here.run("verify", "r", *arguments, "--training-too", "--out", "v").returncode in (0, 1)
    log = excite.read_log(
        here.cwd / "run.txt",
        mapping=excite.read_mapping(here.cwd / "map.yaml"),
        joints=None,
        robot=excite.load_robot(str(here.cwd / "two.yaml")),
    )
    np.testing.assert_allclose(log.q, moved.q, atol=1e-12)


def test_json_holds_the_mapping(here: Here) -> None:
    write_plotjuggler(here.cwd / "p", motion(), ("a", "b", "c"))
    content = json.loads(here.run("logs", "p", "--json").stdout)
    assert content["questions"] == []
    assert [round(one["rate"]) for one in content["streams"]] == [100, 25]
    assert content["mapping"]["position"]["unit"] == ["rad"]
    assert content["mapping"]["joints"] == ["a", "b", "c"]


def test_logs_of_the_house_need_no_mapping(here: Here) -> None:
    (here.cwd / "run.csv").write_text("time,a.position,a.effort\n0,0,0\n0.1,1,2\n0.2,0,1\n0.3,1,1\n", encoding="utf-8")
    shown = here.run("logs", "run.csv").stdout
    assert "as the house format defines" in shown
    assert "no question is left" in shown


REFUSED = {
    "missing": (("logs", "absent"), "cannot read log absent: No such file or directory"),
    "empty": (("logs", "empty"), "empty is an empty file of no known format"),
    "binary": (("logs", "binary"), "binary is a file of no known format"),
    "words": (("logs", "words"), "words holds no table of numbers"),
    "folder of nothing": (("logs", "folder"), "folder is a folder of no known format"),
    "there already": (("logs", "run", "--write-mapping", "words"), "words exists; give another name, or --force"),
    "no positions": (("logs", "plain", "--write-mapping", "map"), "no mapping can be written; Which columns"),
    "unknown robot": (("logs", "run", "--robot", "nobody"), "nobody"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_done_ends_in_one_line(here: Here, name: str) -> None:
    write_rtde(here.cwd / "run", motion(6))
    (here.cwd / "empty").touch()
    (here.cwd / "binary").write_bytes(b"\0\1\2" * 100)
    (here.cwd / "words").write_text("no numbers here\nnone at all\n", encoding="utf-8")
    (here.cwd / "plain").write_text("".join(f"{k},{k % 5}\n" for k in range(200)), encoding="utf-8")
    (here.cwd / "folder").mkdir()
    arguments, said = REFUSED[name]
    ended = here.run(*arguments)
    assert ended.returncode == 2
    assert said in ended.stderr
    assert len(ended.stderr.splitlines()) == 1
    assert not (here.cwd / "map").exists()


def test_an_older_mapping_is_replaced_if_asked(here: Here) -> None:
    write_rtde(here.cwd / "run", motion(6))
    (here.cwd / "map.yaml").write_text("mine", encoding="utf-8")
    assert here.run("logs", "run", "--write-mapping", "map.yaml").returncode == 2
    assert (here.cwd / "map.yaml").read_text(encoding="utf-8") == "mine"
    assert here.run("logs", "run", "--write-mapping", "map.yaml", "--force").returncode == 0
    assert excite.read_mapping(here.cwd / "map.yaml").position.unit == ["rad"]
