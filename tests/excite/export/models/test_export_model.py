"""What every format of identified models holds to: content, comment, notes, and clear ends."""

from __future__ import annotations

import csv
import io
import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from failing_disk import Disk, failing
from identified import identified, result_of
from written_files import text_file

import excite
from excite.export.models.export_model import ModelText
from excite.export.models.exported_model import model_of_result
from excite.export.models.urdf_model import upright
from excite.identification.estimator import Estimate
from excite.identification.identification import Identification
from excite.identification.recipe import Recipe
from excite.registry import BUILT_IN
from excite.tasks.task import Task
from regressors.robot.friction.curve import CoulombViscous, Stribeck, TableFriction
from regressors.robot.friction.curves import FrictionCurves, Side
from regressors.robot.friction.load_and_temperature import Loaded, Slope, Warm

FORMATS = tuple(name for name in BUILT_IN["model format"] if name != "bam")  # which is of servos alone
SIMULATORS = ("urdf", "mjcf", "drake", "isaac", "yaml", "npz")
SCARA = Path(__file__).resolve().parents[3] / "arms" / "scara.urdf"
FEW = {"joints": ("2", "3", "5")}  # quick
ALL_FRICTION = {
    **FEW,
    "offset": True, "root_friction": True, "asymmetric_friction": True, "stribeck": True, "load_share": True,
}  # fmt: skip


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Identification:
    folder = tmp_path_factory.mktemp("result")
    (folder / "result.json").write_text("{}")
    return result_of(excite.load_robot("ur10e"), folder, joint_rotors=True, **FEW)


def content_of(path: Path) -> str:
    if path.suffix != ".npz":
        return path.read_text(encoding="utf-8")
    with np.load(path, allow_pickle=False) as file:
        return "\n".join(file["comment"].tolist())


@pytest.mark.parametrize("form", FORMATS)
def test_every_file_states_where_it_comes_from_and_is_the_same_again(
    form: str, result: Identification, tmp_path: Path
) -> None:
    path = tmp_path / f"robot.{form}"
    exported = excite.export_model(result, form, path)
    assert (exported.files, exported.format) == ((path,), form)
    content = content_of(path).replace("\\", "")
    for text in (sha256(b"{}").hexdigest(), "ur10e", "excite-trajectories", "1.23 %"):
        assert text in content
    assert not re.search(r"20\d\d-\d\d-\d\d", content)
    for note in exported.notes:
        assert note.replace("\\", "") in content
    first = path.read_bytes()
    excite.export_model(result, form, path, replace=True)
    assert path.read_bytes() == first


@pytest.mark.parametrize("form", SIMULATORS)
def test_what_a_format_cannot_express_is_named(form: str, tmp_path: Path) -> None:
    result = result_of(excite.load_robot("ur10e"), tmp_path, **ALL_FRICTION)
    notes = "\n".join(excite.export_model(result, form, tmp_path / f"robot.{form}").notes)
    for what in ("friction offsets", "grows with the load", "root of the speed", "differs between", "Stribeck"):
        assert what in notes
    assert "% of the torques on random states" in notes
    assert ("Coulomb friction (" in notes) == (form == "drake")


def test_tables_list_everything(tmp_path: Path) -> None:
    result = result_of(excite.load_robot("ur10e"), tmp_path, **ALL_FRICTION)
    assert len(model_of_result(result).parameters) == len(result.names)
    for form in ("csv", "md", "tex"):
        exported = excite.export_model(result, form, tmp_path / f"robot.{form}")
        assert not any("cannot express" in note for note in exported.notes)
        content = content_of(tmp_path / f"robot.{form}")
        assert all(name.replace("_", "\\_") in content for name in (*result.names, "m3c3x", "F3s", "F5a"))


def test_the_csv_table_has_every_digit(result: Identification, tmp_path: Path) -> None:
    excite.export_model(result, "csv", tmp_path / "robot.csv")
    lines = [line for line in (tmp_path / "robot.csv").read_text().splitlines() if not line.startswith("#")]
    rows = list(csv.DictReader(io.StringIO("\n".join(lines))))
    base = [row for row in rows if row["part"] == "base parameter"]
    assert tuple(row["name"] for row in base) == result.names
    assert tuple(row["unit"] for row in base) == result.units
    np.testing.assert_array_equal([float(row["value"]) for row in base], result.coefficients)
    for row in base:
        assert float(row["standard deviation"]) == 0.01
        assert float(row["99 % high"]) - float(row["99 % low"]) == pytest.approx(2 * 2.5758 * 0.01, rel=1e-4)
    bodies = np.array([float(row["value"]) for row in rows if row["part"] == "body"]).reshape(-1, 10)
    np.testing.assert_array_equal(bodies, [link.theta for link in model_of_result(result).robot.links])


def test_isaacs_fields_are_numbers_by_joint(result: Identification, tmp_path: Path) -> None:
    notes = excite.export_model(result, "isaac", tmp_path / "isaac.yaml").notes
    group = yaml.safe_load((tmp_path / "isaac.yaml").read_text())["actuators"]["identified"]
    names = result.robot.joint_names
    model = model_of_result(result)
    for field in ("armature", "friction", "dynamic_friction", "viscous_friction", "effort_limit_sim"):
        values = group[field]
        moved = tuple(range(6)) if field == "effort_limit_sim" else (1, 2, 4)
        assert [name for key in values for name in names if re.fullmatch(key, name)] == [names[k] for k in moved]
        assert all(isinstance(value, float) for value in values.values())
    assert list(group["armature"].values()) == [model.armature(k) for k in (1, 2, 4)]
    assert any("not played" in note for note in notes)


def test_drakes_actuators_have_the_reflected_inertia(tmp_path: Path) -> None:
    robot = excite.load_robot("irp6")
    excite.export_model(result_of(robot, tmp_path), "drake", tmp_path / "robot.urdf")
    root = ET.parse(tmp_path / "robot.urdf").getroot()
    stated = [(each, each.find("actuator/{https://drake.mit.edu}gear_ratio")) for each in root.findall("transmission")]
    ratios = {each.find("joint").get("name"): float(ratio.get("value")) for each, ratio in stated if ratio is not None}
    assert ratios == {"q1": 158.0, "q2": 167.5, "q5": 76.8}


TABLE = TableFriction(np.array([-3.0, -1e-6, 1e-6, 3.0]), np.array([-7.0, -1.0, 1.0, 7.0]))
KNOWN = {
    "coulomb": (CoulombViscous(1.0, 2.0, 0.5), (1.0, 2.0), ("friction offsets",)),
    "stribeck": (Stribeck(Side(1.0, 2.0, 1.5)), (1.0, 2.0), ("Stribeck",)),
    "sides": (Stribeck(Side(1.0, 2.0), Side(2.0, 4.0)), (1.5, 3.0), ("friction offsets", "differs between")),
    "load": (Loaded(CoulombViscous(1.0, 2.0), 0.1), (1.0, 2.0), ("grows with the load",)),
    "warm": (Warm(CoulombViscous(1.0, 2.0), 30.0, Slope(0.0, -0.01)), (1.0, 2.0), ("temperature",)),
    "table": (TABLE, (1.0, 2.0), ("tables",)),
}


def test_known_friction_is_written_as_far_as_it_can_be(tmp_path: Path) -> None:
    robot = excite.load_robot("panda")
    plain = result_of(robot, tmp_path, friction=False, joints=("1", "2"))
    for kind, (curve, (coulomb, viscous), said) in KNOWN.items():
        known = replace(plain, friction=FrictionCurves({robot.joint_names[0]: curve}))
        notes = excite.export_model(known, "urdf", tmp_path / f"{kind}.urdf").notes
        dynamics = ET.parse(tmp_path / f"{kind}.urdf").find("joint/dynamics")
        assert float(dynamics.get("friction")) == pytest.approx(coulomb, abs=1e-5)
        assert float(dynamics.get("damping")) == pytest.approx(viscous)
        assert all(any("cannot express" in note and what in note for note in notes) for what in said), kind


@pytest.mark.parametrize(
    ("robot", "options", "words"),
    [
        ("ur10e", {"change": {"I6zz": -5.0}}, r"no physically possible bodies .* by (?!0 %)(?!0\.00)[\d.e-]+ %"),
        ("iiwa7", FEW, r"no inertial parameters of link_2.*1 kg"),
        ("ur10e", {"recipe": Recipe(sign_width=0.05), **FEW}, "direction over a velocity"),
    ],
)
def test_what_was_assumed_is_named(robot: str, options: dict[str, Any], words: str, tmp_path: Path) -> None:
    result = result_of(excite.load_robot(robot), tmp_path, **options)
    notes = excite.export_model(result, "urdf", tmp_path / "r.urdf").notes
    assert any(re.search(words, note) for note in notes)


@pytest.mark.parametrize("gravity", [(0.0, 0.0, -9.81), (0.0, 0.0, 9.81), (9.81, 0.0, 0.0), (1.0, -5.0, 3.0)])
def test_a_tilted_base_stands_upright(gravity: tuple[float, float, float]) -> None:
    R = upright(np.array(gravity))
    np.testing.assert_allclose(R @ gravity, [0, 0, -np.linalg.norm(gravity)], atol=1e-12)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)


class OwnFormat(excite.ModelFormat):
    """The names of the joints."""

    name = "names"
    expresses = frozenset()

    def text(self, model: Any, comment: tuple[str, ...], robot_file: Path | None = None) -> Any:
        return ModelText(" ".join(model.moving), ("in order",))


def test_a_format_of_ones_own(result: Identification, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    exported = excite.export_model(result, OwnFormat(), tmp_path / "names.txt")
    assert (tmp_path / "names.txt").read_text() == "shoulder_lift_joint elbow_joint wrist_2_joint"
    assert exported.notes[-1] == "in order"
    assert any("names cannot express Coulomb friction" in note for note in exported.notes)
    (tmp_path / "my_format.py").write_text("from excite.export.models.plain_models import CsvTable as Mine\n")
    monkeypatch.chdir(tmp_path)
    assert excite.export_model(result, "my_format:Mine", tmp_path / "t.csv").files == (tmp_path / "t.csv",)


BAD: tuple[tuple[dict[str, Any], str], ...] = (
    ({"format": "sdf"}, "no model format named 'sdf'"),
    ({"format": 3}, "format: expected text or a ModelFormat, given 3"),
    ({"format": "csv", "robot_file": "a.urdf"}, "takes none"),
    ({"format": "urdf", "robot_file": "a.yaml"}, "takes one that ends in .urdf, .xml"),
    ({"format": "urdf", "robot_file": "missing.urdf"}, "cannot read"),
    ({"out": "."}, "it is a folder"),
    ({"out": "there.urdf"}, "already there; `replace` replaces it"),
    ({"result": 3}, "expected a result of `identify`"),
    ({"result": "nowhere"}, "holds no result"),
)


def test_bad_input_is_named_and_nothing_is_written(
    result: Identification, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("there.urdf").write_text("mine")
    for given, says in BAD:
        call = {"result": result, "format": "urdf", "out": "new.urdf", **given}
        with pytest.raises(excite.ExciteError, match=re.escape(says)):
            excite.export_model(call.pop("result"), call.pop("format"), call.pop("out"), **call)
        assert Path("there.urdf").read_text() == "mine"
        assert not Path("new.urdf").exists()


def test_a_load_has_no_robot_to_write(tmp_path: Path) -> None:
    robot = excite.load_robot("irp6")
    nothing = Estimate("weighted", (), (), np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0)), 1)
    loaded = identified(robot, Task("irp6", model="load"), Recipe(), nothing, tmp_path)
    with pytest.raises(excite.InputError, match="result of a load, which has no robot to write"):
        excite.export_model(loaded, "urdf", tmp_path / "new.urdf")


def test_a_full_disk_leaves_the_old_file(result: Identification, tmp_path: Path) -> None:
    path = text_file(tmp_path / "robot.urdf", "old")
    with failing(Disk(tmp_path, at=1, how="full")), pytest.raises(excite.InputError, match="cannot write"):
        excite.export_model(result, "urdf", path, replace=True)
    assert path.read_text() == "old"
    left = {file.name for file in tmp_path.iterdir()} - {path.name}
    assert all(name.endswith((".lock", ".writer.json")) for name in left)


def test_names_with_hyphens_and_ampersands_stay_xml(tmp_path: Path) -> None:
    named = excite.load_robot("ur10e").replace(name='a--b<&>"c---d')
    for form in ("urdf", "mjcf"):
        excite.export_model(result_of(named, tmp_path, **FEW), form, tmp_path / f"r.{form}")
        root = ET.parse(tmp_path / f"r.{form}").getroot()
        assert root.get("name", root.get("model")) == named.name


def test_prismatic_joints_are_written(tmp_path: Path) -> None:
    robot = excite.load_robot(str(SCARA))
    excite.export_model(result_of(robot, tmp_path), "urdf", tmp_path / "r.urdf")
    again = excite.load_robot(str(tmp_path / "r.urdf"))
    assert [(joint.name, joint.kind) for joint in again.joints] == [(joint.name, joint.kind) for joint in robot.joints]
    np.testing.assert_allclose(again.limits.lower, robot.limits.lower)
