"""``excite export`` of designs and of results: what it writes and refuses."""

from __future__ import annotations

import hashlib
import json
import shutil
import signal
import sys
from pathlib import Path

import numpy as np
import pytest
from commands import Here, table_of
from designed import irp6, panda, ur10e
from processes import running, stderr_of, until
from written_files import saved
from written_results import design, result

import excite
from excite.cli.exchange_commands import export
from excite.design.design_json import find_design
from excite.export.motions.universal_robots import UrScript
from excite.registry import MODEL_FORMATS
from excite.views import figures

# ``excite export``: what it writes and refuses, and designs that ``excite identify`` finds by their hash.


OWN = """\
import excite
from excite.export.motions.motion_format import Interpolation, MotionFile, house_recorder


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
def exporting(here: Here) -> Here:
    for name, made in (("irp6", irp6), ("ur10e", ur10e), ("panda", panda)):
        shutil.copytree(made().folder, here.cwd / "designs" / name)
    return here


UNFIT: dict[str, tuple[str, ...]] = {
    "panda --format krl": ("6 joints", "panda has 7"),
    "ur10e --format franka": ("7 joints", "shoulder_pan_joint"),
    "ur10e --format urscript --rate 300": ("125 Hz (CB-Series)",),
    "panda --format franka --rate 500": ("--rate 500 Hz", "takes 1000 Hz"),
    "ur10e --format rtde --rate 1000": ("1 to 500 Hz",),
    "irp6 --format npz --rate 1e6": ("500000 or fewer", "lower --rate"),
    "ur10e --format krl --out play/2motion.src": ("letters, digits",),
    f"ur10e --format krl --out play/{25 * 'a'}.src": ("24 at most",),
    "ur10e --format rapid --out play/mo-tion.mod": ("letters, digits",),
    "ur10e --format mcap --out play/motion.bag": ("ends in .mcap",),
    "irp6 --format mine:Plain": ("no module",),
    "irp6 --format urdf": ("a format of models", "holds a design", "choose ros2-yaml"),
    "missing --format npz": ("holds no design",),
    "irp6 --format npz --robot-file a.urdf": ("--robot-file",),
    "irp6 --format npz --rate 5.9": ("too low to show", "give 6 Hz or more"),
}


def test_what_does_not_fit_is_one_line_and_no_file(exporting: Here) -> None:
    for line, words in UNFIT.items():
        arguments = line.split()
        suffix = {"krl": ".src", "urscript": ".script", "npz": ".npz"}.get(arguments[2], ".csv")
        out = () if "--out" in arguments else ("--out", f"play/motion{suffix}")
        said = exporting.refused("export", f"designs/{arguments[0]}", *arguments[1:], *out)
        assert all(word in said for word in words), said
    slow = ("designs/panda", "--format", "ros2-yaml", "--rate", "3", "--out", "play/motion.csv")
    assert "breaks a limit" in exporting.refused("export", *slow, status=1)


def test_without_rosbags_it_says_how_to_install_them(exporting: Here, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] == "rosbags"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "rosbags", None)
    said = exporting.refused("export", "designs/ur10e", "--format", "mcap", "--out", "a.mcap")
    assert "pip install 'excite-trajectories[ros]'" in said


def test_a_format_of_one_s_own_and_what_is_none(exporting: Here) -> None:
    half = "class Half(excite.MotionFormat):\n    name, default_rate, file, recorder = 'half', 20.0, Plain.file, None"
    (exporting.cwd / "mine.py").write_text(f"{OWN}\n\n{half}\n\nnumber = 3\n")
    exporting.monkeypatch.setattr(sys, "path", [*sys.path])
    exporting.monkeypatch.delitem(sys.modules, "mine", raising=False)
    ended = exporting.run("export", "designs/irp6", "--format", "mine:Plain", "--out", "a.txt", "--json")
    content = json.loads(ended.stdout)
    assert (content["format"], content["rate"]) == ("mine:Plain", 20.0)
    assert (exporting.cwd / "a.txt").read_text() == f"{irp6().file_sha256} 41"
    for name, words in {
        "mine:Half": "does not state its fastest, interpolation, checked",
        "mine:number": "motion format mine:number: expected a MotionFormat, a class of such",
        "excite:MotionFormat": "abstract",
        "mine:Missing": "no 'Missing'",
    }.items():
        assert words in exporting.refused("export", "designs/irp6", "--format", name, "--out", "b.txt")


def test_prismatic_joints_have_no_angles() -> None:
    any_joints = type("AnyJoints", (UrScript,), {"joints": ()})
    robot = excite.load_robot(str(Path(__file__).parents[2] / "arms" / "gantry.urdf"))
    with pytest.raises(excite.InputError, match="prismatic ones"):
        any_joints().check_robot(robot)


def test_a_design_that_was_not_saved_is_found_by_its_coefficients(tmp_path: Path) -> None:
    search = excite.Search(starts=1, executor="serial", seed=3)
    design = excite.design_trajectory("irp6", period=2.0, harmonics=2, search=search)
    written = excite.export_motion(design, "npz", tmp_path / "a.npz", rate=50.0)
    mapping = excite.read_mapping(written.files[-1])
    assert mapping.design == excite.load_design(saved(tmp_path / "designs" / "later", design)).coefficients_sha256
    assert find_design(mapping.design, [tmp_path / "designs"]) == tmp_path / "designs" / "later"
    assert find_design(mapping.design, [tmp_path]) is None  # not deeper than one folder


@pytest.fixture
def log(exporting: Here) -> Path:
    """A log of all five joints of irp6, of which the design moves three."""
    exporting.run("simulate", "designs/irp6", "--out", "run.csv", "--rate", "200", "--torque-noise", "0.5", status=0)
    header, table = table_of(exporting.cwd / "run.csv")
    still = [f"{joint}.{what}" for joint in ("q4", "q5") for what in ("position", "velocity", "effort")]
    table = np.hstack([table, np.zeros((len(table), len(still)))])
    (exporting.cwd / "run.json").unlink()
    path = exporting.cwd / "run.csv"
    np.savetxt(path, table, delimiter=",", header=",".join([*header, *still]), comments="")
    exporting.monkeypatch.setattr(figures, "write_figures", lambda *_, **__: [])
    return path


IDENTIFY = ("identify", "irp6", "run.csv", "--choose", "none", "--out", "results")


def identified(exporting: Here, *arguments: str) -> tuple[str, object]:
    ended = exporting.run(*IDENTIFY, *arguments, "--force")
    assert ended.returncode in (0, 1), ended.stderr
    return ended.stderr, json.loads((exporting.cwd / "results" / "result.json").read_text())["design"]


@pytest.mark.slow
def test_identify_finds_the_design_by_its_hash(exporting: Here, log: Path) -> None:
    assert exporting.run("export", "designs/irp6", "--format", "npz", "--out", "play/a.npz").returncode == 0
    mapping = ("--mapping", "play/a.npz.mapping.yaml")
    said, design = identified(exporting, *mapping)  # in the folder designs
    assert "designs/irp6 holds the design" in said
    assert design["sha256"] == irp6().file_sha256
    (exporting.cwd / "designs").rename(exporting.cwd / "elsewhere")
    said, design = identified(exporting, *mapping)
    assert "its model is not used" in said
    assert design is None
    for how in (("--designs", "elsewhere"), ("--design", "elsewhere/irp6")):
        assert identified(exporting, *mapping, *how)[1]["sha256"] == irp6().file_sha256


def test_identify_refuses_another_design_than_the_mapping_names(exporting: Here, log: Path) -> None:
    assert exporting.run("export", "designs/ur10e", "--format", "npz", "--out", "a.npz").returncode == 0
    ended = exporting.run(*IDENTIFY, "--mapping", "a.npz.mapping.yaml", "--design", "designs/irp6")
    assert (ended.returncode, "of another design" in ended.stderr) == (2, True), ended.stderr


# ``excite export`` of a result: a model that other programs load.


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("made")
    result("old").save(made / "r")
    result("old").save(made / "both")
    design("old").save(made / "both")
    return made


@pytest.fixture
def exporting_models(here: Here, folder: Path) -> Here:
    for made in folder.iterdir():
        (here.cwd / made.name).symlink_to(made)
    return here


def test_the_summary_as_text_and_as_json(exporting_models: Here) -> None:
    arguments = ("export", "both", "--format", "urdf", "--out", "models/irp6.urdf")  # which no motion has
    text = exporting_models.run(*arguments).stdout
    assert "written: models/irp6.urdf" in text
    assert "note: URDF cannot express rotor inertias" in text
    content = json.loads(exporting_models.run(*arguments, "--force", "--json").stdout)
    assert (content["format"], content["files"]) == ("urdf", ["models/irp6.urdf"])
    assert any("drives that move several joints" in note for note in content["notes"])
    sha256 = hashlib.sha256((exporting_models.cwd / "both" / "result.json").read_bytes()).hexdigest()
    assert sha256 in (exporting_models.cwd / "models" / "irp6.urdf").read_text()
    exporting_models.run("export", "r", "--format", "npz", "--out", "models/irp6.npz", status=0)  # motions have it too


def test_the_help_names_every_format_of_models() -> None:
    assert [form for form in MODEL_FORMATS if form not in (export.epilog or "")] == []


WRONG = {
    "r --format urdf --robot-file none.urdf": ("cannot read", "none.urdf"),
    "r --format csv --robot-file none.urdf": ("--robot-file", "takes none"),
    "r --format urdf --rate 100": ("--rate",),
    "both --format npz": ("result.json", "design.json"),
    "r --format urdf --seed 1": ("--seed", "--samples N"),
    "both/design.json --format npz --samples 3": ("--samples", "holds a design"),
    "r --format krl": ("krl is a format of motions", "holds a result", "choose urdf"),
    "r --format bam": ("BAM holds servos", "identify with the model servo"),
}


def test_models_that_do_not_fit_are_one_line_and_no_file(exporting_models: Here) -> None:
    for arguments, words in WRONG.items():
        said = exporting_models.refused("export", *arguments.split(), "--out", "models/new.urdf")
        assert all(word in said for word in words), said


def test_an_ensemble_is_a_folder_of_robots(exporting_models: Here) -> None:
    arguments = ("export", "r", "--format", "mjcf", "--samples", "3", "--level", "0.6", "--out", "models/many")
    text = exporting_models.run(*arguments).stdout
    assert "Ensemble of 3 possible robots exported as mjcf" in text
    names = {path.name for path in (exporting_models.cwd / "models" / "many").iterdir()}
    assert names == {"ensemble.json", "ranges.yaml", "samples.npz", *(f"irp6-000{k}.xml" for k in (1, 2, 3))}
    again = exporting_models.run(*arguments)
    assert (again.returncode, "--force" in again.stderr) == (2, True)
    content = json.loads(exporting_models.run(*arguments, "--force", "--json").stdout)
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
