"""Completion by the shell, as click's protocol asks for it, in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from commands import ENVIRONMENT, SCRIPT

from excite.registry import BUILT_IN
from regressors.readers.library import built_in_names

CASES = {
    "excite de": {"design"},
    "excite friction ": {"plan", "fit"},
    "excite friction fi": {"fit"},
    "excite design irp": {"irp6", "irp6-full", "irp"},  # the last: files
    "excite design irp6 --model ": set(BUILT_IN["model"]),
    "excite design irp6 --criterion s": {"sigma-min"},
    "excite plan irp6 --model e": {"energy"},
    "excite export d --format ur": {"urscript", "urdf"},
    "excite identify irp6 run.csv --estimator p": {"physical"},
    "excite logs run.csv --robot pa": {"panda", "pa"},
    "excite design irp6 --torque-m": {"--torque-margin"},
    "excite payload identify --contr": {"--controller"},
}


def completed(line: str, cwd: Path, shell: str = "bash") -> list[str]:
    """What a shell gets for a line whose last word is being typed."""
    words = line.split(" ")
    asked = {"COMP_WORDS": line, "COMP_CWORD": str(len(words) - 1), "_EXCITE_COMPLETE": f"{shell}_complete"}
    if shell == "fish":
        asked["COMP_CWORD"] = words[-1]
    ended = subprocess.run(SCRIPT, cwd=cwd, env={**ENVIRONMENT, **asked}, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (0, "")
    return ended.stdout.splitlines()


@pytest.mark.parametrize("line", CASES)
def test_names_are_completed(line: str, tmp_path: Path) -> None:
    assert {one.partition(",")[2] for one in completed(line, tmp_path)} == CASES[line]


def test_every_robot_is_completed_in_every_shell(tmp_path: Path) -> None:
    for shell in ("bash", "zsh", "fish"):
        text = "\n".join(completed("excite robots ", tmp_path, shell))
        assert all(name in text for name in built_in_names())


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_shells_get_their_script(shell: str, tmp_path: Path) -> None:
    asked = {**ENVIRONMENT, "_EXCITE_COMPLETE": f"{shell}_source"}
    ended = subprocess.run(SCRIPT, cwd=tmp_path, env=asked, capture_output=True, text=True, check=False)
    assert f"_EXCITE_COMPLETE={shell}_complete" in ended.stdout


def test_completing_imports_only_the_command_and_nothing_heavy(tmp_path: Path) -> None:
    program = (
        "import sys\n"
        "from excite.cli.main import main\n"
        "sys.argv = ['excite']\n"
        "try:\n    main()\nfinally:\n    print(*sys.modules, file=sys.stderr)\n"
    )
    asked = {"COMP_WORDS": "excite de", "COMP_CWORD": "1", "_EXCITE_COMPLETE": "bash_complete"}
    ended = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        env={**os.environ, **asked},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.stdout == "plain,design\n"
    modules = set(ended.stderr.split())
    assert not {"numpy", "casadi", "rich", "excite.cli.design_command"} & modules
