"""Sizes of an MJCF: predicted as measured, refused before MuJoCo allocates them, and never in the way of a robot."""

from __future__ import annotations

import os
import re
import resource
import struct
import subprocess
import sys
import time
import zlib
from collections.abc import Callable
from pathlib import Path

import pytest
from refused import refusal

from regressors.errors import TooLargeError
from regressors.readers import mjcf as mjcf_size
from regressors.readers.library import load_robot
from regressors.readers.mjcf import check_mjcf_size

pytest.importorskip("mujoco", reason="mujoco is not installed (pip install mujoco)")

LINK = '<body name="l"><joint name="j" axis="0 1 0"/><geom size=".1"/></body>'


def model(asset: str = "", world: str = "", head: str = "") -> str:
    return f"<mujoco>{head}<asset>{asset}</asset>\n<worldbody>{LINK}{world}</worldbody></mujoco>"


def png(wide: int, high: int) -> bytes:
    """The head of an image, which may be as large as it says."""
    head = struct.pack(">IIBBBBB", wide, high, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + b"IHDR" + head + struct.pack(">I", zlib.crc32(b"IHDR" + head))


# Text of the model, what the refusal says, and files beside it.
IMAGE, PART = '<texture name="t" type="2d" file="t.png"/>', '<include file="part.xml"/>'
MANY = b"<mujocoinclude>" + b"<site/>" * 200 + b"</mujocoinclude>"
ATTACHED = '<replicate count="90"><attach model="m" prefix="a"/></replicate>'
FLAT = '<texture name="t" {} builtin="flat" width="{}" height="{}"/>'
FIELD = '<hfield name="h" {} size="1 1 1 1"/>'
GRID = '<flexcomp name="f" type="grid" count="1000 1000 1" spacing="1 1 1" radius="1"/>'
OBJECTS = "".join(f'<mesh name="m{k}" file="m{k}.obj"/>' for k in range(3))
LARGE: dict[str, tuple[str, str, dict[str, bytes]]] = {
    "texture": (
        model(FLAT.format('type="2d"', 60000, 60000)),
        r"arm\.xml would take about 21\.6 GB of memory, more than the cap of 4 GB: a texture of 60000 x 60000",
        {},
    ),
    "cube": (model(FLAT.format("", 20000, 20000)), r"about 14\.4 GB of memory", {}),
    "image in a folder": (
        model(IMAGE, head='<compiler texturedir="images"/>'),
        r"t\.png, an image of 50000 x 50000",
        {"images/t.png": png(50000, 50000)},
    ),
    "height field": (model(FIELD.format('nrow="30000" ncol="30000"')), "field of 30000 x 30000", {}),
    "height field of a file": (
        model(FIELD.format('file="h.bin"')),
        r"h\.bin, a height field of 100000 x 100000",
        {"h.bin": struct.pack("<ii", 10**5, 10**5)},
    ),
    "mesh": (model('<mesh name="m" file="m.stl"/>'), r"it has 70 MB, more than the 67", {"m.stl": b"sparse 70000000"}),
    "meshes": (model(OBJECTS), r"about 5\.4 GB of memory", {f"m{k}.obj": b"sparse 60000000" for k in range(3)}),
    "replicate": (
        model(world='\n<replicate count="100000000" offset="1 0 0"><site/></replicate>'),
        r"arm\.xml, line 3: with this <replicate> the model has 1e\+08 elements, more than the 10000 that a robot may",
        {},
    ),
    "replicated include": (
        model(world=f'<replicate count="90">{PART}</replicate>'),
        r"part\.xml, line 1: with this <site>",
        {"part.xml": MANY},
    ),
    "attached models": (
        model('<model name="m" file="part.xml"/>', ATTACHED),
        "with this <attach>",
        {"part.xml": model(world="<site/>" * 200).encode()},
    ),
    "grid": (model(world=GRID), r"with this <flexcomp> the model has 1e\+06 elements", {}),
    "include of itself": (model(world='<include file="arm.xml"/>'), r"arm\.xml: arm\.xml includes itself", {}),
    "includes without end": (
        model(world=PART * 60),
        r"arm\.xml: it and what it includes have more than 268 MB of text",
        {"part.xml": b"<mujocoinclude>" + b" " * 6 * 10**6 + b"</mujocoinclude>"},
    ),
}


@pytest.mark.parametrize(("text", "message", "files"), LARGE.values(), ids=LARGE)
def test_what_is_too_large_is_refused(text: str, files: dict[str, bytes], message: str, tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text(text, encoding="utf-8")
    for name, content in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(content)
        if content.startswith(b"sparse"):
            os.truncate(tmp_path / name, int(content.split()[1]))
    began, before = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert re.search(message, refusal(load_robot, str(tmp_path / "arm.xml")))
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 2e5  # kB
    assert time.process_time() - began < 60


def test_the_cap_moves_with_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "arm.xml").write_text(model('<texture type="2d" builtin="flat" width="2000" height="2000"/>'))
    check_mjcf_size(tmp_path / "arm.xml")
    monkeypatch.setenv("EXCITE_MEMORY_CAP", "0.02")
    with pytest.raises(TooLargeError, match=r"about 24 MB .* cap of 20 MB"):
        check_mjcf_size(tmp_path / "arm.xml")


@pytest.mark.parametrize("asset", ["mesh", "texture", "hfield", "skin", "include", "model"])
@pytest.mark.parametrize(
    ("make", "message"),
    [
        (os.mkfifo, "it is a pipe, expected a file|nothing came through"),
        (lambda path: path.symlink_to("/dev/zero"), "it is a device, expected a file"),
        (lambda path: path.symlink_to("/proc/self/status"), "MuJoCo does not compile it|more than the cap"),
        (Path.mkdir, "Is a directory"),
    ],
    ids=["pipe", "device", "proc", "folder"],
)
def test_what_is_no_file_is_refused(
    asset: str, make: Callable[[Path], None], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("regressors.input_files.SILENCE", 0.05)
    make(tmp_path / "part")
    (tmp_path / "arm.xml").write_text(model(f'<{asset} name="a" file="part"/>'))
    assert re.search(message, refusal(load_robot, str(tmp_path / "arm.xml")))


MEASURE = """
import re, sys
import mujoco
def peak(): return 1024 * int(re.search(r"VmHWM:\\s+(\\d+)", open("/proc/self/status").read()).group(1))
before = peak()
mujoco.MjModel.from_xml_path(sys.argv[1])
print(peak() - before)
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "asset",
    [
        '<texture name="t" type="2d" builtin="checker" width="5000" height="5000"/>',
        '<texture name="t" builtin="checker" width="3000" height="3000"/>',
        '<hfield name="h" nrow="3000" ncol="3000" size="1 1 1 1"/>',
    ],
)
def test_predictions_are_within_a_factor_of_two_of_what_mujoco_takes(
    asset: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    predicted: list[float] = []
    monkeypatch.setattr(mjcf_size, "check_memory", lambda _, size, *__: predicted.append(size))
    path = tmp_path / "arm.xml"
    path.write_text(model(asset, '<geom type="hfield" hfield="h"/>' if "hfield" in asset else ""))
    check_mjcf_size(path)
    done = subprocess.run([sys.executable, "-c", MEASURE, str(path)], capture_output=True, check=True)
    assert 0.5 < predicted[0] / float(done.stdout) < 2.0
