"""The page of claims: its tables are those of the results, and everything that is measured can be reached from it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from commands import module_of

BENCHMARKS = Path(__file__).resolve().parents[1] / "benchmarks"
PAGE = (BENCHMARKS / "README.md").read_text(encoding="utf-8")
CLAIMS = [section for section in re.split(r"^## ", PAGE, flags=re.MULTILINE)[1:] if "<!--" in section]


def test_tables_are_those_of_the_results() -> None:
    assert module_of(BENCHMARKS / "claims.py").filled(PAGE) == PAGE  # benchmarks/record.py writes them anew


def test_every_table_stands_on_the_page() -> None:
    assert re.findall(r"<!-- (\w+) -->", PAGE) == list(module_of(BENCHMARKS / "claims.py").TABLES)


def test_page_is_short() -> None:
    assert len(PAGE.splitlines()) <= 150


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda claim: claim.partition("\n")[0])
def test_a_claim_is_a_sentence_a_table_its_limitation_a_command_and_a_link(claim: str) -> None:
    form = r"[^\n]+\n\n[^|]+\.\n\n<!-- (\w+) -->\n(\|[^\n]*\|\n)+<!-- end of \1 -->\n\nLimitation: [^|]+\n+"
    assert re.fullmatch(form, claim)
    scripts = re.findall(r"benchmarks/[\w/]+\.py", claim)
    assert scripts
    assert all((BENCHMARKS.parent / script).is_file() for script in scripts)
    assert re.search(r"\]\([\w/]+\.md\)", claim)


def test_tables_hold_no_prose() -> None:
    cells = [cell.strip() for line in PAGE.splitlines() if line.startswith("|") for cell in line.split("|")]
    assert [cell for cell in cells if len(cell) > 50 or re.search(r"\. |: ", cell)] == []


def linked(page: Path) -> set[Path]:
    """Pages that can be reached from one."""
    reached, ahead = {page}, [page]
    while ahead:
        here = ahead.pop()
        targets = re.findall(r"\]\(([\w./-]+\.md)(?:#[\w-]+)?\)", here.read_text(encoding="utf-8"))
        new = {(here.parent / target).resolve() for target in targets} - reached
        assert all(each.is_file() for each in new), here
        reached |= new
        ahead += new
    return reached


def test_every_page_and_result_can_be_reached() -> None:
    expected = {*BENCHMARKS.rglob("README.md"), *(BENCHMARKS / "results").glob("*.md"), BENCHMARKS / "details.md"}
    assert sorted(expected - linked(BENCHMARKS / "README.md")) == []
