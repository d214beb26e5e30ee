"""``excite export``: what it writes and refuses, and designs that ``excite identify`` finds by their hash."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from commands import Here, table_of
from designed import irp6, panda, ur10e

import excite
from excite.design.design_json import find_design
from excite.export.motions.universal_robots import UrScript
from excite.views import figures

OWN = """\
import excite
from excite.export.motions.motion_format import Interpolation
from excite.export.motions.motion_format import MotionFile
from excite.export.motions.motion_format import house_recorder


class Plain(excite.MotionFormat):
    name = "plain"
    default_rate, fastest = 20.0, 100.0
    interpolation = Interpolation.NONE
    checked = "nothing was checked"

    def file(self, motion, stem):
        return MotionFile(f"{motion.sha256} {motion.time.size}".encode())

    def recorder(self, motion, name):
        return house_recorder(motion)
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Here:
    for name, design in (("irp6", irp6), ("ur10e", ur10e), ("panda", panda)):
        (tmp_path / "designs").mkdir(exist_ok=True)
        shutil.copytree(design().folder, tmp_path / "designs" / name)
    return Here(tmp_path, monkeypatch, capfd)


@pytest.mark.slow
def test_summary_as_text_and_as_json(here: Here) -> None:
    arguments = ("export", "designs/irp6", "--format", "npz", "--out", "play/a.npz")
    text = here.run(*arguments).stdout
    assert text.startswith("Motion exported as npz, within its limits; ")
    assert "written to play: a.npz, a.npz.mapping.yaml" in text
    content = json.loads(here.run(*arguments, "--rate", "250", "--force", "--json").stdout)
    assert (content["format"], content["rate"], content["samples"], content["duration"]) == ("npz", 250.0, 501, 2.0)
    assert content["design"] == irp6().file_sha256
    assert content["files"] == ["play/a.npz", "play/a.npz.mapping.yaml"]


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (("designs/panda", "--format", "krl"), 2, ("6 joints", "panda has 7")),
        (("designs/panda", "--format", "urscript"), 2, ("6 joints",)),
        (("designs/ur10e", "--format", "franka"), 2, ("7 joints", "shoulder_pan_joint")),
        (("designs/panda", "--format", "franka", "--rate", "500"), 2, ("--rate 500 Hz", "takes 1000 Hz")),
        (("designs/ur10e", "--format", "rtde", "--rate", "1000"), 2, ("1 to 500 Hz",)),
        (("designs/ur10e", "--format", "urscript", "--rate", "300"), 2, ("125 Hz (CB-Series)",)),
        (("designs/ur10e", "--format", "egm", "--rate", "251"), 2, ("10 to 250 Hz",)),
        (("designs/irp6", "--format", "npz", "--rate", "1e6"), 2, ("500000 or fewer", "lower --rate")),
        (("designs/irp6", "--format", "npz", "--rate", "nan"), 2, ("rate",)),
        (("designs/irp6", "--format", "nope"), 2, ("ros2-yaml",)),
        (("designs/irp6", "--format", "mine:Plain"), 2, ("no module",)),
        (("designs/irp6", "--format", "urdf"), 2, ("a format of models", "holds a design", "choose ros2-yaml")),
        (("designs", "--format", "npz"), 2, ("holds no design",)),
        (("missing", "--format", "npz"), 2, ("holds no design",)),
        (("designs/irp6", "--format", "npz", "--robot-file", "a.urdf"), 2, ("--robot-file",)),
        (("designs/irp6", "--format", "npz", "--rate", "5.9"), 2, ("too low to show", "give 6 Hz or more")),
        (("designs/panda", "--format", "ros2-yaml", "--rate", "3"), 1, ("breaks a limit", "raise --rate")),
    ],
)
def test_what_does_not_fit_is_one_line_and_no_file(
    here: Here, arguments: tuple[str, ...], status: int, words: tuple[str, ...]
) -> None:
    suffix = {"krl": ".src", "urscript": ".script", "npz": ".npz"}.get(arguments[2], ".csv")
    said = here.refused("export", *arguments, "--out", f"play/motion{suffix}", status=status)
    assert all(word in said for word in words), said


@pytest.mark.parametrize(
    ("form", "name", "word"),
    [
        ("krl", "play/2motion.src", "letters, digits"),
        ("krl", "play/a_name_of_more_than_24_letters.src", "24 at most"),
        ("rapid", "play/mo-tion.mod", "letters, digits"),
        ("urscript", "play/mo tion.script", "letters, digits"),
        ("mcap", "play/motion.bag", "ends in .mcap"),
        ("npz", "play/motion", "ends in .npz"),
    ],
)
@pytest.mark.slow
def test_names_that_a_format_cannot_have(here: Here, form: str, name: str, word: str) -> None:
    assert word in here.refused("export", "designs/ur10e", "--format", form, "--out", name)


@pytest.mark.slow
def test_files_that_are_there_stay_without_force(here: Here) -> None:
    (here.cwd / "a.csv.mapping.yaml").write_text("mine")
    arguments = ("designs/ur10e", "--format", "rtde", "--rate", "125", "--out", "a.csv")
    assert "a.csv.mapping.yaml already there" in here.refused("export", *arguments)
    assert here.run("export", *arguments, "--force").returncode == 0
    assert (here.cwd / "a.csv.record.xml").exists()
    assert here.run("export", "designs/ur10e", "--format", "egm", "--out", "a.csv", "--force").returncode == 0
    assert not (here.cwd / "a.csv.record.xml").exists()  # of the other format


def test_a_design_whose_coefficients_were_changed_is_refused(here: Here) -> None:
    path = here.cwd / "designs" / "irp6" / "design.json"
    content = json.loads(path.read_text())
    content["trajectory"]["sine"][0][0] += 0.1
    path.write_text(json.dumps(content))
    assert "coefficients" in here.refused("export", "designs/irp6", "--format", "npz", "--out", "a.npz")
    del content["trajectory"]["sine"], content["sha256"]
    path.write_text(json.dumps(content))
    here.refused("export", "designs/irp6", "--format", "npz", "--out", "a.npz")


def test_without_rosbags_it_says_how_to_install_them(here: Here, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] == "rosbags"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "rosbags", None)
    said = here.refused("export", "designs/ur10e", "--format", "mcap", "--out", "a.mcap")
    assert "pip install 'excite-trajectories[ros]'" in said


def test_a_format_of_one_s_own(here: Here) -> None:
    (here.cwd / "mine.py").write_text(OWN)
    here.monkeypatch.setattr(sys, "path", [*sys.path])
    here.monkeypatch.delitem(sys.modules, "mine", raising=False)
    content = json.loads(
        here.run("export", "designs/irp6", "--format", "mine:Plain", "--out", "a.txt", "--json").stdout
    )
    assert (content["format"], content["rate"]) == ("mine:Plain", 20.0)
    assert (here.cwd / "a.txt").read_text() == f"{irp6().file_sha256} 41"


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("mine:Half", "does not state its fastest, interpolation, checked"),
        ("mine:number", "motion format mine:number: expected a MotionFormat, a class of such"),
        ("excite:MotionFormat", "abstract"),
        ("mine:Missing", "no 'Missing'"),
    ],
)
def test_formats_that_are_none(here: Here, name: str, words: str) -> None:
    gone = "for gone in ('fastest', 'interpolation', 'checked'):\n    delattr(Plain, gone)\n"
    half = f"class Half(Plain):\n    pass\n\n{gone}"
    (here.cwd / "mine.py").write_text(f"{OWN}\n\n{half}\nnumber = 3\n")
    here.monkeypatch.setattr(sys, "path", [*sys.path])
    here.monkeypatch.delitem(sys.modules, "mine", raising=False)
    assert words in here.refused("export", "designs/irp6", "--format", name, "--out", "a.txt")


def test_prismatic_joints_have_no_angles() -> None:
    any_joints = type("AnyJoints", (UrScript,), {"joints": ()})
    robot = excite.load_robot(str(Path(__file__).parents[2] / "arms" / "gantry.urdf"))
    with pytest.raises(excite.InputError, match="prismatic ones"):
        any_joints().check_robot(robot)


def test_a_design_that_was_not_saved_is_found_by_its_coefficients(tmp_path: Path) -> None:
    design = excite.design_trajectory(
        "irp6", period=2.0, harmonics=2, search=excite.Search(starts=1, executor="serial", seed=3)
    )
    written = excite.export_motion(design, "npz", tmp_path / "a.npz", rate=50.0)
    mapping = excite.read_mapping(written.files[-1])
    design.save(tmp_path / "designs" / "later")
    assert mapping.design == excite.load_design(tmp_path / "designs" / "later").coefficients_sha256
    assert mapping.design is not None
    assert find_design(mapping.design, [tmp_path / "designs"]) == tmp_path / "designs" / "later"
    assert find_design(mapping.design, [tmp_path]) is None  # not deeper than one folder


@pytest.fixture
def log(here: Here) -> Path:
    """A log of all five joints of irp6, of which the design moves three."""
    ended = here.run("simulate", "designs/irp6", "--out", "run.csv", "--rate", "200", "--torque-noise", "0.5")
    assert ended.returncode == 0, ended.stderr
    header, table = table_of(here.cwd / "run.csv")
    still = [f"{joint}.{what}" for joint in ("q4", "q5") for what in ("position", "velocity", "effort")]
    table = np.hstack([table, np.zeros((len(table), len(still)))])
    (here.cwd / "run.json").unlink()
    path = here.cwd / "run.csv"
    np.savetxt(path, table, delimiter=",", header=",".join([*header, *still]), comments="")
    here.monkeypatch.setattr(figures, "write_figures", lambda *_, **__: [])
    return path


IDENTIFY = ("identify", "irp6", "run.csv", "--choose", "none", "--out", "results")


def identified(here: Here, *arguments: str) -> tuple[str, object]:
    ended = here.run(*IDENTIFY, *arguments, "--force")
    assert ended.returncode in (0, 1), ended.stderr
    return ended.stderr, json.loads((here.cwd / "results" / "result.json").read_text())["design"]


@pytest.mark.slow
def test_identify_finds_the_design_by_its_hash(here: Here, log: Path) -> None:
    assert here.run("export", "designs/irp6", "--format", "npz", "--out", "play/a.npz").returncode == 0
    mapping = ("--mapping", "play/a.npz.mapping.yaml")
    said, design = identified(here, *mapping)  # in the folder designs
    assert "designs/irp6 holds the design" in said
    assert isinstance(design, dict)
    assert design["sha256"] == irp6().file_sha256
    (here.cwd / "designs").rename(here.cwd / "elsewhere")
    said, design = identified(here, *mapping)
    assert "its model is not used" in said
    assert design is None
    said, design = identified(here, *mapping, "--designs", "elsewhere")
    assert isinstance(design, dict)
    ended = here.run(*IDENTIFY, *mapping, "--design", "elsewhere/ur10e", "--force")
    assert ended.returncode == 2
    ended = here.run(*IDENTIFY, *mapping, "--design", "elsewhere/irp6", "--force")
    assert ended.returncode in (0, 1)


def test_identify_refuses_another_design_than_the_mapping_names(here: Here, log: Path) -> None:
    assert here.run("export", "designs/ur10e", "--format", "npz", "--out", "a.npz").returncode == 0
    ended = here.run(*IDENTIFY, "--mapping", "a.npz.mapping.yaml", "--design", "designs/irp6")
    assert (ended.returncode, "of another design" in ended.stderr) == (2, True), ended.stderr
