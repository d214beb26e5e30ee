"""README and docs: links lead to files and headings; commands run as printed, page by page, and print what is shown."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import pytest
from commands import module_of
from public_arms import ARMS, robots_folder

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
LINK = re.compile(r"(?<!!)\[[^\]]*\]\(([^)\s]+)\)|!\[[^\]]*\]\(([^)\s]+)\)")
FENCE = re.compile(
    r"(?:<!-- file: (?P<file>\S+) -->\n)?^```(?P<kind>\w*)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL
)
OWN_CRITERION = ROOT / "docs" / "examples" / "own_criterion.py"
ARM = """<robot name="arm"><link name="base"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <origin xyz="0 0 0.4"/><limit lower="-2" upper="2" velocity="2" effort="100"/></joint>
  <link name="upper"><inertial><origin xyz="0.1 0 0"/><mass value="4"/>
    <inertia ixx="0.02" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="forearm"/><axis xyz="0 1 0"/>
    <origin xyz="0 0.1 0.1"/><limit lower="-1.5" upper="1.5" velocity="2" effort="80"/></joint>
  <link name="forearm"><inertial><origin xyz="0 0 0.15"/><mass value="3"/>
    <inertia ixx="0.03" iyy="0.03" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="roll" type="revolute"><parent link="forearm"/><child link="wrist"/><axis xyz="0 0 1"/>
    <origin xyz="0 0 0.35"/><limit lower="-2" upper="2" velocity="3" effort="30"/></joint>
  <link name="wrist"><inertial><origin xyz="0.02 0 0.05"/><mass value="1"/>
    <inertia ixx="0.003" iyy="0.003" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><sphere radius="0.05"/></geometry></collision></link>
</robot>"""


@cache
def anchors(page: Path) -> frozenset[str]:
    """Anchors of a page's headings, as GitHub forms them."""
    headings = re.findall(r"^#+ (.+)$", FENCE.sub("", page.read_text(encoding="utf-8")), re.MULTILINE)
    return frozenset(re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_files_and_headings(page: Path) -> None:
    text = FENCE.sub("", page.read_text(encoding="utf-8"))
    for target in (link or image for link, image in LINK.findall(text)):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = unquote(target).partition("#")
        file = (page.parent / path).resolve() if path else page
        assert file.exists(), f"{page.relative_to(ROOT)}: {target}"
        assert file.is_relative_to(ROOT)
        assert not anchor or anchor in anchors(file), f"{page.relative_to(ROOT)}: {target}"


def test_readme_fits_two_screens() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 150


OUTPUTS = module_of(ROOT / "docs" / "show_outputs.py")


def commands_of(page: Path) -> list[Any]:
    """Commands on a page, in its order, with the lines that the page shows below them."""
    blocks = OUTPUTS.BLOCK.finditer(page.read_text(encoding="utf-8"))
    return [each for block in blocks if block["kind"] == "console" for each in OUTPUTS.commands(block["text"])]


def beginnings(lines: list[str]) -> set[str]:
    """First two words of each line that begins with one.

    Numbers differ from machine to machine, and with the motion that a search ends in there also which parameters are
    the least certain, whose names are no words, and what notes say.
    """
    spoken = (line for line in lines if re.match(r"[A-Za-z]{3}", line) and not line.startswith("note"))
    return {" ".join(re.findall(r"[A-Za-z]+", line)[:2]) for line in spoken}


WITH_COMMANDS = [page for page in PAGES if any(each.words[0] == "excite" for each in commands_of(page))]


def written_files(page: Path, folder: Path) -> None:
    """What a page's commands read: the files that it shows, robots, an arm, and a part of the reader's own."""
    text = page.read_text(encoding="utf-8")
    if OUTPUTS.ROBOTS.search(text) and robots_folder() is None:
        pytest.skip("example-robot-data is not installed (pip install example-robot-data)")
    OUTPUTS.write_files(text, folder)
    shutil.copy(OWN_CRITERION, folder)
    if "--tip tool0" in page.read_text(encoding="utf-8"):
        shutil.copy(next(arm.path for arm in ARMS if arm.id == "ur10"), folder / "arm.urdf")
    else:
        (folder / "arm.urdf").write_text(ARM, encoding="utf-8")


def with_few_starts(command: Any) -> Any:
    """A design with a quarter of its starts, at least two, or with one where its search ends when more do not pay."""
    words = list(command.words)
    if words[:2] == ["excite", "design"] and "--starts" in words:
        at = words.index("--starts") + 1
        words[at] = str(max(int(words[at]) // 4, min(int(words[at]), 2)))
    elif words[:2] == ["excite", "design"] and "auto" not in words:
        words += ["--starts", "1"]
    return replace(command, words=tuple(words))


@pytest.mark.slow
@pytest.mark.parametrize("page", WITH_COMMANDS, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_run_as_printed(page: Path, tmp_path: Path) -> None:
    written_files(page, tmp_path)
    for command in commands_of(page):
        if command.runs(tmp_path):
            status, printed = OUTPUTS.run(with_few_starts(command), tmp_path)
            assert status == command.status, f"{command.printed}\n{printed[-2000:]}"
            words = " ".join(re.findall(r"[A-Za-z]+", printed))  # where a line is broken depends on its numbers
            stale = {beginning for beginning in beginnings(command.shown) if beginning not in words}
            assert not stale, (
                f"{command.printed} does not print that any more; docs/show_outputs.py fills in what it does"
            )


def test_every_command_that_prints_shows_it() -> None:
    bare = [
        (page.name, command.printed)
        for page in OUTPUTS.pages()
        for block in OUTPUTS.BLOCK.finditer(page.read_text(encoding="utf-8"))
        if block["mark"] == "prints"
        for command in OUTPUTS.commands(block["text"])
        if not command.shown
    ]
    assert bare == []


def test_figures_of_pages_are_small() -> None:
    most = {"docs/tutorials/figures/*.png": 200_000, "docs/figures/*.svg": 60_000, "docs/front.*": 400_000}
    figures = {figure: size for places, size in most.items() for figure in ROOT.glob(places)}
    assert {figure.parent for figure in figures} == {ROOT / Path(places).parent for places in most}
    assert [figure.name for figure, size in figures.items() if figure.stat().st_size > size] == []


def test_figures_of_the_paper_are_those_that_a_script_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    drawn = {f"paper-{name}.svg" for name in module_of(ROOT / "docs" / "draw_paper.py").FIGURES}
    shown = re.findall(r"\(figures/(.+?)\)", (ROOT / "docs" / "paper.md").read_text(encoding="utf-8"))
    assert sorted(shown) == sorted(drawn) == sorted(path.name for path in (ROOT / "docs" / "figures").iterdir())


def test_what_is_supported_is_said_once() -> None:
    texts = [(ROOT / page).read_text(encoding="utf-8") for page in ("README.md", "docs/index.md")]
    tables = {re.search(r"^\| \| supported (?:.+\n)+", text, re.MULTILINE)[0] for text in texts}  # type: ignore[index]
    assert len(tables) == 1
