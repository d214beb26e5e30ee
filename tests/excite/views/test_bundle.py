"""The bundled player is built from the sources beside it, and asks nothing of a network."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path

REPORT = Path(__file__).resolve().parents[3] / "excite" / "views"
PLAYER = REPORT / "page" / "player.min.js"
BUNDLE = REPORT / "bundle"


def test_player_is_built_from_its_sources() -> None:
    files = [*sorted((BUNDLE / "player").glob("*.js")), BUNDLE / "package-lock.json"]
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()
    assert PLAYER.read_text(encoding="utf-8").startswith(f"/* sources {digest};"), "run excite/views/bundle/build.sh"


def test_versions_are_pinned_and_the_licence_is_there() -> None:
    package = json.loads((BUNDLE / "package.json").read_text(encoding="utf-8"))
    lock = json.loads((BUNDLE / "package-lock.json").read_text(encoding="utf-8"))["packages"]
    for name, wanted in package["devDependencies"].items():
        assert lock[f"node_modules/{name}"]["version"] == wanted
    assert "MIT License" in (REPORT / "page" / "three.LICENSE").read_text(encoding="utf-8")


def test_player_stands_in_a_page_and_asks_nothing_of_a_network() -> None:
    text = PLAYER.read_text(encoding="utf-8")
    assert not re.search(r"</script|<!--", text, re.IGNORECASE)
    assert not re.search(r"\beval\(|new Function\(|importScripts|WebSocket|sendBeacon", text)
