"""The site and the page of claims: numbers are those of the results, what is named exists, links lead somewhere."""

from __future__ import annotations

import importlib
import importlib.util
import re
from pathlib import Path

import click
import pytest
from commands import module_of

import excite
from excite.cli.main import cli

# The site: its numbers are those of the results, what it names exists, and links lead where they should.


ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
OF_OTHER_PROGRAMS = ("development.md", "set-up.md")
PLACE = re.compile(r"`((?:excite|constraints|regressors)(?:\.\w+)+:\w+)`")


def test_numbers_are_those_of_the_results_and_every_table_stands_on_a_page() -> None:
    fill = module_of(DOCS / "fill_numbers.py")
    assert fill.outdated() == []  # docs/fill_numbers.py writes them anew
    text = "".join(page.read_text(encoding="utf-8") for page in (ROOT / "README.md", *DOCS.rglob("*.md")))
    assert [name for name in fill.TABLES if f"<!-- numbers: {name} -->" not in text] == []


PLACES = [
    pytest.param(place, id=f"{page.stem}-{place}")
    for page in sorted(DOCS.rglob("*.md"))
    for place in PLACE.findall(page.read_text(encoding="utf-8"))
]


@pytest.mark.parametrize("place", PLACES)
def test_what_a_page_names_exists(place: str) -> None:
    module, _, name = place.partition(":")
    assert hasattr(importlib.import_module(module), name)


def flags(command: click.Command) -> set[str]:
    """Options of a command and of those below it."""
    own = {flag for each in command.params for flag in (*each.opts, *each.secondary_opts)}
    if not isinstance(command, click.Group):
        return own
    context = click.Context(command)
    below = [command.get_command(context, name) for name in command.list_commands(context)]
    return own.union(*(flags(each) for each in below if each is not None))


def test_options_that_pages_name_exist() -> None:
    known = {*flags(cli), "--help", "--json", "--stdin"}  # the last of ros2
    pages = [page for page in sorted(DOCS.rglob("*.md")) if page.name not in OF_OTHER_PROGRAMS]
    prose = {page: re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.MULTILINE | re.DOTALL) for page in pages}
    named = {(page.name, flag) for page, text in prose.items() for flag in re.findall(r"(?<![\w-])--[a-z][\w-]*", text)}
    assert sorted((page, flag) for page, flag in named if flag not in known) == []


def test_every_public_name_has_a_page() -> None:
    pytest.importorskip("sphinx", reason="the site needs Sphinx")
    groups = module_of(DOCS / "extensions/public_names.py").groups()
    listed = sorted(name for names in groups.values() for name in names)
    assert listed == sorted(dir(excite))


def test_links_lead_to_pages_where_there_are_some() -> None:
    pytest.importorskip("sphinx", reason="the site needs Sphinx")
    page, known = DOCS / "how-to" / "identify.md", {
        "../../benchmarks/README.md#quality": "../benchmarks/index.md#quality",
        "../../benchmarks/coverage/README.md": "../benchmarks/coverage.md",
        "../examples": "../examples.md",
        "../set-up.sh": "path:../set-up.sh",
        "../../CITATION.cff": "path:../../CITATION.cff",
        **{same: same for same in ("../front.png", "design.md#limits", "#limits", "https://docs.python.org")},
    }  # fmt: skip
    rewritten = module_of(DOCS / "extensions/repository_files.py").rewritten
    for target, expected in known.items():
        text = f"see [this]({target})\n\n```sh\n[that]({target})\n```\n"
        assert rewritten(text, page, page, DOCS) == text.replace(f"[this]({target})", f"[this]({expected})")
    with pytest.raises(Exception, match=r"nowhere\.md leads to no file and no page"):
        rewritten("[this](nowhere.md)", page, page, DOCS)


def test_an_equation_is_drawn_in_the_size_of_the_text() -> None:
    pytest.importorskip("sphinx", reason="the site needs Sphinx")
    drawing = module_of(DOCS / "extensions/drawn_equations.py").drawing
    low, high = (drawing(tex) for tex in ("x", r"\frac{x}{y}"))
    heights = [float(re.search(r"height:([\d.]+)em", svg)[1]) for svg in (low, high)]  # type: ignore[index]
    assert 0.3 < heights[0] < 0.8 < heights[1] < 2.0
    assert 'aria-label="x"' in low
    with pytest.raises(ValueError, match="Unknown symbol"):
        drawing(r"\nonsense")


# The page of claims: its tables are those of the results, and everything that is measured can be reached from it.


BENCHMARKS = Path(__file__).resolve().parents[1] / "benchmarks"
PAGE = (BENCHMARKS / "README.md").read_text(encoding="utf-8")
CLAIMS = [section for section in re.split(r"^## ", PAGE, flags=re.MULTILINE)[1:] if "<!--" in section]


def test_tables_are_those_of_the_results_and_all_stand_on_one_short_page() -> None:
    claims = module_of(BENCHMARKS / "claims.py")
    assert claims.filled(PAGE) == PAGE  # benchmarks/record.py writes them anew
    assert re.findall(r"<!-- (\w+) -->", PAGE) == list(claims.TABLES)
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


# Numbers that were measured have a source: in the section that states them, or in the table that is filled in.


MEASURED = re.compile(
    r"[\d.,]*\d\s*(?:times|%)\s+(?:as \w+ as|sooner|faster|slower|less|more|better|lower|fewer|smaller|larger)\b"
    r"|[\d.,]*\d\s*(?:CPU s\b|s of (?:CPU|processor) time|CPU seconds)"
    r"|\d % of (?:\w+ )?(?:intervals|them) (?:hold|held)"
)
ANSWERABLE = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted({*DOCS.rglob("*.md")} - {DOCS / "task_options.md"})]


def unsourced(text: str) -> list[str]:
    """Numbers that compare or time in sections that name no benchmark."""
    prose = re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)
    prose = re.sub(r"<!-- numbers: (\S+) -->.*?<!-- end of \1 -->", "", prose, flags=re.DOTALL)
    sections = re.split(r"^#+ ", prose, flags=re.MULTILINE)
    return [found[0] for each in sections if "benchmarks/" not in each for found in MEASURED.finditer(each)]


@pytest.mark.parametrize("page", ANSWERABLE, ids=lambda page: page.stem)
def test_what_was_measured_names_its_source(page: Path) -> None:
    assert unsourced(page.read_text(encoding="utf-8")) == []


def test_a_claim_without_a_source_is_seen() -> None:
    assert unsourced("# A\n\nIt is 4 times faster, after 30 CPU s.\n") == ["4 times faster", "30 CPU s"]
    assert unsourced("# A\n\nIt is 4 times faster (`benchmarks/search.py`).\n") == []


def test_only_what_is_lowest_is_bold() -> None:
    rows = [line for line in (BENCHMARKS / "results/quality.md").read_text().splitlines() if line.startswith("| P")]
    assert rows
    for ours, *others in (line.strip("| ").split(" | ")[2:5] for line in rows):
        lowest = "(" not in "".join(others) and float(ours.strip("*")) < min(map(float, others))
        assert ours.startswith("**") == lowest, (ours, others)


# The house stays as small as it has become.


HOUSE = ROOT / "docs" / "measure_house.py"


@pytest.mark.slow
def test_nothing_is_larger_than_its_bound() -> None:
    module = module_of(HOUSE)
    larger = {name: count for name, count in module.measured().items() if count > module.BOUNDS[name]}
    assert larger == {}


def test_the_page_has_the_bounds() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    bounds = module_of(HOUSE).BOUNDS.items()
    assert [name for name, most in bounds if f"| {name} |" not in page or f"| {most:,} |" not in page] == []
