"""The site: its numbers are those of the results, what it names exists, and links lead where they should."""

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

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
OF_OTHER_PROGRAMS = ("development.md", "set-up.md")
PLACE = re.compile(r"`((?:excite|constraints|regressors)(?:\.\w+)+:\w+)`")


def test_numbers_are_those_of_the_results() -> None:
    fill = module_of(DOCS / "fill_numbers.py")
    assert fill.pages()
    assert fill.outdated() == []  # docs/fill_numbers.py writes them anew


def test_every_table_of_numbers_stands_on_a_page() -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in (DOCS.parent / "README.md", *DOCS.rglob("*.md")))
    assert all(f"<!-- numbers: {name} -->" in text for name in module_of(DOCS / "fill_numbers.py").TABLES)


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


@pytest.mark.parametrize(
    ("target", "expected"),
    [
        ("../../benchmarks/README.md#quality", "../benchmarks/index.md#quality"),
        ("../../benchmarks/coverage/README.md", "../benchmarks/coverage.md"),
        ("../examples", "../examples.md"),
        ("../set-up.sh", "path:../set-up.sh"),
        ("../../CITATION.cff", "path:../../CITATION.cff"),
        ("../front.png", "../front.png"),
        ("design.md#limits", "design.md#limits"),
        ("#limits", "#limits"),
        ("https://docs.python.org", "https://docs.python.org"),
    ],
)
def test_links_lead_to_pages_where_there_are_some(target: str, expected: str) -> None:
    pytest.importorskip("sphinx", reason="the site needs Sphinx")
    page = DOCS / "how-to" / "identify.md"
    text = f"see [this]({target})\n\n```sh\n[that]({target})\n```\n"
    shown = module_of(DOCS / "extensions/repository_files.py").rewritten(text, page, page, DOCS)
    assert shown == text.replace(f"[this]({target})", f"[this]({expected})")


def test_links_that_lead_nowhere_are_refused() -> None:
    pytest.importorskip("sphinx", reason="the site needs Sphinx")
    page = DOCS / "how-to" / "identify.md"
    with pytest.raises(Exception, match=r"nowhere\.md leads to no file and no page"):
        module_of(DOCS / "extensions/repository_files.py").rewritten("[this](nowhere.md)", page, page, DOCS)


def test_an_equation_is_drawn_in_the_size_of_the_text() -> None:
    pytest.importorskip("sphinx", reason="the site needs Sphinx")
    drawing = module_of(DOCS / "extensions/drawn_equations.py").drawing
    low, high = (drawing(tex) for tex in ("x", r"\frac{x}{y}"))
    heights = [float(re.search(r"height:([\d.]+)em", svg)[1]) for svg in (low, high)]  # type: ignore[index]
    assert 0.3 < heights[0] < 0.8 < heights[1] < 2.0
    assert 'aria-label="x"' in low
    with pytest.raises(ValueError, match="Unknown symbol"):
        drawing(r"\nonsense")
