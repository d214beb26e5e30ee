"""Bounds of the commands: too much work is refused at once, what is no file too; text of others is literal."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from commands import Here

from excite.cli.literal_console import LiteralConsole
from excite.cli.messages import in_options
from excite.design.optimisation import design_trajectory
from excite.tasks.task import Task
from regressors import input_files

ESCAPE = "\x1b[31m"
LARGE = {
    "design irp6 --harmonics 1000 --rate 1000 --workers 2 --out out": "--harmonics",
    "design irp6 --trajectory bspline --intervals 900 --workers 2 --out out": "--intervals",
    "design irp6 --home 0,0,0,0,0 --settle 1e5 --rate 1e4 --out out": "--settle",
    "design irp6 --model energy --window-length 1e-6 --out out": "--window-length",
    "simulate irp6 --rate 1e7 --out run.csv": "--rate",
    "simulate irp6 --periods 100000 --out run.csv": "--periods",
    "friction plan irp6 --warm-up 1e5 --out out": "--warm-up",
    "friction plan irp6 --repeats 100000 --out out": "--repeats",
    "study irp6 --design irp6 --points 1000000 --repeats 1000000 --out out": "--points",
}


@pytest.fixture(scope="module")
def design(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("designs") / "irp6"
    design_trajectory(Task("irp6", harmonics=3, starts=1, executor="serial")).save(folder)
    return folder


@pytest.mark.parametrize("command", LARGE)
def test_too_much_work_is_refused_at_once(here: Here, design: Path, command: str) -> None:
    (here.cwd / "irp6").symlink_to(design)
    line = here.refused(*command.split())
    assert f"{LARGE[command]} " in line
    assert "more than the cap of 4 GB" in line
    assert line.endswith("would do, or raise the cap with EXCITE_MEMORY_CAP [GB]\n")


def test_the_cap_counts(here: Here, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("EXCITE_MEMORY_CAP", "0.1")
    assert "more than the cap of 100 MB" in here.refused("design", "irp6", "--out", "out")


@pytest.mark.parametrize(
    "command",
    [
        "design irp6 --task {} --out out",
        "design irp6 --world {} --out out",
        "design irp6 --friction-curves {} --out out",
        "design irp6 --prior {} --out out",
        "identify irp6 {} --out out",
        "identify irp6 run.csv --mapping {} --out out",
        "friction plan irp6 --world {} --out out",
    ],
)
def test_commands_refuse_devices_and_silent_pipes(here: Here, monkeypatch: pytest.MonkeyPatch, command: str) -> None:
    monkeypatch.setattr(input_files, "SILENCE", 0.05)
    os.mkfifo(here.cwd / "pipe")
    for file, why in (("/dev/zero", "it is a device"), ("pipe", "nothing came through it")):
        ended = here.run(*command.format(file).split())
        assert ended.returncode == 2
        assert why in ended.stderr.splitlines()[-1]
        assert not (here.cwd / "out" / "design.json").exists()


BAD_TEXT = {
    "long cell": "time,a.position\n0,0\n1," + 5000 * "z" + "\n",
    "escape in a cell": f"time,a.position\n0,0\n1,{ESCAPE}\n",
    "escape in a name": f"time,{ESCAPE}.position\n0,0\n1,0\n",
    "long names": "time," + ",".join(f"{k}{100 * 'n'}.position" for k in range(900)) + "\n",
}


@pytest.mark.parametrize("case", BAD_TEXT)
@pytest.mark.parametrize("name", ["log.csv", f"{ESCAPE}log.csv"])
def test_errors_echo_the_text_of_files_cut_and_literally(here: Here, case: str, name: str) -> None:
    (here.cwd / name).write_text(BAD_TEXT[case])
    ended = here.run("identify", "irp6", name, "--out", "out")
    assert ended.returncode == 2
    for line in ended.stderr.splitlines():  # progress too, where it takes long
        assert len(line) <= 510
        assert line.isprintable()


TYPED = ((f"--{ESCAPE}",), ("--harmonics", ESCAPE), ("--task", f"{ESCAPE}.yaml"), (9000 * "x",))


@pytest.mark.parametrize("options", TYPED)
def test_what_was_typed_is_echoed_cut_and_literally(here: Here, options: tuple[str, ...]) -> None:
    line = here.refused("design", "irp6", *options, "--out", "out").rstrip("\n")
    assert (line.isprintable(), len(line) <= 510) == (True, True)


def test_an_alias_bomb_is_refused(here: Here) -> None:
    levels = "\n".join(f"a{k}: &a{k} [{', '.join(9 * [f'*a{k - 1}'])}]" for k in range(1, 12))
    (here.cwd / "bomb.yaml").write_text(f"a0: &a0 [x]\n{levels}\n")
    said = here.refused("design", "irp6", "--task", "bomb.yaml", "--out", "out")
    assert "anchors and aliases" in said
    assert len(said) <= 510


@pytest.mark.parametrize("name", ["bomb.urdf", "bomb.xacro", "bomb.xml"])
def test_entities_are_not_expanded(here: Here, name: str) -> None:
    entities = "".join(f'<!ENTITY e{k} "{10 * f"&e{k - 1};"}">' for k in range(1, 12))
    (here.cwd / name).write_text(f'<!DOCTYPE robot [<!ENTITY e0 "x">{entities}]><robot name="&e11;"/>')
    assert "DOCTYPE" in here.refused("robots", name)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("deep.yaml", "a: " + 50_000 * "["),
        ("deep.yaml", "\n".join(k * " " + "a:" for k in range(3000))),
        ("deep.urdf", '<robot name="r">' + 100_000 * "<link>"),
        ("deep.urdf", '<robot name="r">' + 100_000 * "<a>" + 100_000 * "</a>" + "</robot>"),
    ],
)
def test_nesting_is_bounded(here: Here, name: str, text: str) -> None:
    (here.cwd / name).write_text(text)
    here.refused("robots", name)


def test_the_console_prints_names_literally(capsys: pytest.CaptureFixture[str]) -> None:
    LiteralConsole(markup=False, highlight=False, width=80).print(f"[red]{ESCAPE}a\x9bb\rc\nd", style="bold")
    shown = capsys.readouterr().out
    assert "[red]" in shown
    assert shown.replace("\n", "").isprintable()
    assert shown.splitlines()[1].strip() == "d"


def test_options_in_messages_are_literal() -> None:
    assert in_options(f"`torque_margin` of {ESCAPE}") == r"--torque-margin of \x1b[31m"
