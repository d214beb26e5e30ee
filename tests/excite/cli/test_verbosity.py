"""--quiet, --verbose, --json and the older --format json mean the same before and after every command."""

from __future__ import annotations

import json

import pytest
from commands import Here

VERDICT = "2 motions of at most 2 drives identify all 13 parameters of irp6 (energy model).\n"


@pytest.mark.parametrize("words", ["-q plan irp6", "plan -q irp6", "plan irp6 --quiet", "--quiet plan irp6"])
def test_quiet_prints_the_verdict_alone(words: str, here: Here) -> None:
    ended = here.run(*words.split())
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, VERDICT, "")


@pytest.mark.parametrize("words", ["-v plan irp6", "plan irp6 --verbose"])
def test_verbose_prints_all_tables_and_versions(words: str, here: Here) -> None:
    shown = here.run(*words.split()).stdout
    assert shown.startswith(VERDICT)
    assert "What each selection of drives identifies" in shown
    assert "excite 0.1.0, Python 3." in shown.splitlines()[-1]


@pytest.mark.parametrize(
    "words", ["plan irp6 --json", "plan irp6 --format json", "-q plan irp6 --json", "-v plan irp6 --json"]
)
def test_json_is_one_document(words: str, here: Here) -> None:
    content = json.loads(here.run(*words.replace("ROBOT", "irp6").split()).stdout)
    assert (content["verdict"], content["rank"]) == (VERDICT.strip(), 13)


def test_what_excludes_each_other(here: Here) -> None:
    for words in ("-q -v plan irp6", "-q plan irp6 -v"):
        ended = here.run(*words.split())
        assert (ended.returncode, ended.stdout) == (2, "")
        assert "--quiet and --verbose exclude each other" in ended.stderr


def test_a_quiet_error_is_still_said(here: Here) -> None:
    ended = here.run("-q", "plan", "irp7")
    assert (ended.returncode, ended.stdout, ended.stderr.count("\n")) == (2, "", 1)


def test_verbose_names_the_files_that_are_read(here: Here, capfd: pytest.CaptureFixture[str]) -> None:
    (here.cwd / "irp.yaml").write_text("name: irp\n")
    for words, named in ((("plan", "irp.yaml"), False), (("-v", "plan", "irp.yaml"), True)):
        here.monkeypatch.setattr("commands.without_steps", lambda text: text)
        ended = here.run(*words)
        assert ("excite: reading irp.yaml ..." in ended.stderr) == named


def test_robots_are_listed_by_name(here: Here) -> None:
    names = here.run("robots", "-q").stdout.split()
    assert names == [robot["name"] for robot in json.loads(here.run("robots", "--json").stdout)]
    assert here.run("robots", "irp6", "-q").stdout.startswith("irp6: 5 joints; ")
