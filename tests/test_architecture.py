"""What docs/architecture.md and its drawing say of the rooms is what there is."""

from __future__ import annotations

import ast
import importlib
import os
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

import excite

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PACKAGES = ("regressors", "constraints", "excite")
DIVIDED = ("excite/export",)  # into rooms of its own
UPWARD = "#d00000"
ENVIRONMENT = {**os.environ, "MPLBACKEND": "Agg"}


def rooms() -> set[str]:
    """Modules and folders of the packages, without what begins with an underscore but `__main__`."""
    places = {
        place
        for top in (*PACKAGES, *DIVIDED)
        for place in (ROOT / top).iterdir()
        if place.suffix == ".py" or (place / "__init__.py").is_file()
    }
    names = {".".join(place.relative_to(ROOT).with_suffix("").parts) for place in places}
    return {name for name in names if not name.endswith("__init__")} - {top.replace("/", ".") for top in DIVIDED}


def drawn(file: Path) -> list[str]:
    """Rooms in a drawing."""
    text = file.read_text(encoding="utf-8")
    names = re.findall(r'id="room:([^"]+)"', text)
    labels = re.findall(r"<text[^>]*>([^<]+)</text>", text)
    assert {name.partition(".")[2] for name in names} <= set(labels)
    return names


@pytest.fixture(scope="module")
def drawing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Drawing made from today's imports."""
    out = tmp_path_factory.mktemp("drawing") / "rooms.svg"
    subprocess.run([sys.executable, DOCS / "draw_rooms.py", "--out", out], cwd=out.parent, env=ENVIRONMENT, check=True)
    return out


def test_the_drawing_has_every_room_once_in_the_order_of_the_layers_and_no_arrow_up(drawing: Path) -> None:
    assert sorted(drawn(drawing)) == sorted(rooms())
    assert drawn(drawing) == drawn(DOCS / "rooms.svg")
    assert (DOCS / "rooms.svg").stat().st_size < 200_000
    assert UPWARD not in drawing.read_text(encoding="utf-8")


def test_an_arrow_that_points_up_is_red(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code = compile((DOCS / "draw_rooms.py").read_text(encoding="utf-8"), DOCS / "draw_rooms.py", "exec")
    module: dict[str, Any] = {"__name__": "draw_rooms", "__file__": str(DOCS / "draw_rooms.py")}
    exec(code, module)
    monkeypatch.setitem(module, "imports", lambda names: Counter({("excite.registry", "excite.cli"): 1}))
    module["main"](["--out", str(tmp_path / "up.svg")])
    assert UPWARD in (tmp_path / "up.svg").read_text(encoding="utf-8")


def test_the_drawing_is_the_same_every_time(drawing: Path, tmp_path: Path) -> None:
    again = tmp_path / "again.svg"
    subprocess.run([sys.executable, DOCS / "draw_rooms.py", "--out", again], env=ENVIRONMENT, check=True)
    assert again.read_bytes() == drawing.read_bytes()


def test_every_room_is_explained() -> None:
    text = (DOCS / "architecture.md").read_text(encoding="utf-8")
    part = re.split(r"^`(\w+)` ", text, flags=re.MULTILINE)  # introduction, then each package's name and text
    explained = {
        (package, name)
        for package, of_package in zip(part[1::2], part[2::2], strict=True)
        for line in of_package.splitlines()
        if line.startswith("| `")
        for name in re.findall(r"`([\w.]+)`", line.split("|")[1])
    }
    assert {tuple(room.split(".", 1)) for room in rooms()} - explained == set()


def test_the_drawing_and_every_example_of_a_part_are_linked() -> None:
    text = (DOCS / "architecture.md").read_text(encoding="utf-8")
    links = re.findall(r"\]\(([^)#]+)\)", text)
    own = {f"examples/{path.name}" for path in (DOCS / "examples").glob("own_*.py")}
    assert {"rooms.svg", *own} <= set(links)


def test_what_scripts_import_is_there() -> None:
    """Scripts of the documentation and most benchmarks run seldom; a name that has moved would show only then."""
    missing = []
    for path in (*DOCS.rglob("*.py"), *(ROOT / "benchmarks").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] in PACKAGES:
                module = importlib.import_module(node.module)
                missing += [f"{path}: {node.module}.{n.name}" for n in node.names if not hasattr(module, n.name)]
            elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "excite":
                missing += [] if hasattr(excite, node.attr) else [f"{path}: excite.{node.attr}"]
    assert missing == []
