"""The house stays as small as it has become."""

from __future__ import annotations

from pathlib import Path

import pytest
from commands import module_of

ROOT = Path(__file__).resolve().parents[1]
HOUSE = ROOT / "docs" / "measure_house.py"


@pytest.mark.slow
def test_nothing_is_larger_than_its_bound() -> None:
    module = module_of(HOUSE)
    larger = {name: count for name, count in module.measured().items() if count > module.BOUNDS[name]}
    assert larger == {}


def test_the_page_has_the_bounds() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    missing = [
        name
        for name, bound in module_of(HOUSE).BOUNDS.items()
        if f"| {name} |" not in page or f"| {bound:,} |" not in page
    ]
    assert missing == []
