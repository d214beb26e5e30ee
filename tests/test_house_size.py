"""The house stays as small as it has become."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[1]


def house() -> ModuleType:
    spec = importlib.util.spec_from_file_location("measure_house", ROOT / "docs" / "measure_house.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_nothing_is_larger_than_its_bound() -> None:
    module = house()
    larger = {name: count for name, count in module.measured().items() if count > module.BOUNDS[name]}
    assert larger == {}


def test_the_page_has_the_bounds() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    missing = [
        name for name, bound in house().BOUNDS.items() if f"| {name} |" not in page or f"| {bound:,} |" not in page
    ]
    assert missing == []
