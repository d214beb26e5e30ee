"""Names of megabytes are refused where a robot is read, in one short line; those of any real robot are not."""

from __future__ import annotations

from pathlib import Path

import pytest

import excite
from regressors.errors import LONGEST_LINE, LONGEST_NAME, InputError

LONG = "x" * 1_000_000
BODY = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
LIMIT = '<limit lower="-1" upper="1" velocity="1" effort="1"/>'
URDF = (
    f'<robot name="ROBOT"><link name="base"/><link name="LINK">{BODY}</link><link name="SIDE"/>'
    f'<joint name="JOINT" type="revolute"><parent link="base"/><child link="LINK"/><axis xyz="0 0 1"/>{LIMIT}</joint>'
    '<joint name="FIXED" type="fixed"><parent link="LINK"/><child link="SIDE"/></joint></robot>'
)
MJCF = (
    '<mujoco model="ROBOT"><worldbody><body name="LINK"><joint name="JOINT" type="hinge" range="-1 1" limited="true"/>'
    '<geom size="0.1"/></body></worldbody></mujoco>'
)
DH = "# convention: modified\nname,alpha,a,d,theta,lower,upper\nJOINT,0,0,0,0,-1,1\n"
FILES = {"arm.urdf": URDF, "arm.xml": MJCF, "arm.csv": DH}


def read(folder: Path, file: str, **names: str) -> object:
    text = FILES[file]
    for what in ("ROBOT", "LINK", "SIDE", "JOINT", "FIXED"):
        text = text.replace(what, names.get(what, what.lower()))
    (folder / file).write_text(text)
    return excite.load_robot(folder / file)


@pytest.mark.parametrize(
    ("file", "what"),
    [(file, what) for file in FILES for what in ("ROBOT", "LINK", "SIDE", "JOINT", "FIXED") if what in FILES[file]],
)
def test_a_name_of_a_megabyte_is_refused(file: str, what: str, tmp_path: Path) -> None:
    if file == "arm.xml":
        pytest.importorskip("mujoco")
    with pytest.raises(InputError, match=f"at most {LONGEST_NAME} characters, given ") as refused:
        read(tmp_path, file, **{what: LONG})
    assert len(str(refused.value)) < LONGEST_LINE


@pytest.mark.parametrize("file", FILES)
def test_the_longest_names_are_read(file: str, tmp_path: Path) -> None:
    if file == "arm.xml":
        pytest.importorskip("mujoco")
    assert read(tmp_path, file, JOINT="j" * LONGEST_NAME) is not None


@pytest.mark.parametrize("place", ["name: irp6", "name: q1", "name: column", "name: z1"])
def test_descriptions(place: str, tmp_path: Path) -> None:
    import regressors.readers.library as library

    text = (Path(library.__file__).parent.parent / "robots" / "irp6.yaml").read_text()
    assert place in text
    (tmp_path / "arm.yaml").write_text(text.replace(place, f"name: {LONG}", 1))
    with pytest.raises(InputError, match=f"at most {LONGEST_NAME} characters, given 1000000") as refused:
        excite.load_robot(tmp_path / "arm.yaml")
    assert len(str(refused.value)) < LONGEST_LINE
