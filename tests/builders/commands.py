"""The commands as a user types them, from any folder: each in a process of its own, or (quicker) in this one."""

from __future__ import annotations

import csv
import importlib.util
import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest

from excite.cli.main import cli, main

ENVIRONMENT = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
MODULE = [sys.executable, "-m", "excite"]
SCRIPT = [str(Path(sys.executable).with_name("excite"))]
QUICK = ("--starts", "2", "--harmonics", "3", "--executor", "serial")


def run_process(
    command: Sequence[str], cwd: Path, environment: Mapping[str, str] = ENVIRONMENT, **more: Any
) -> subprocess.CompletedProcess[str]:
    """Run a process to its end, and keep what it prints; more are options of `subprocess.run`."""
    given = {"check": False, "timeout": 300.0, **more}
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, **given)


def run(
    *arguments: str,
    cwd: Path,
    command: list[str] = MODULE,
    status: int | None = None,
    stderr: str | None = None,
    **environment: str,
) -> subprocess.CompletedProcess[str]:
    """Run ``excite ...`` to its end, which must be with this exit status and stderr, if they are given."""
    ended = run_process([*command, *arguments], cwd, {**ENVIRONMENT, **environment}, timeout=120.0)
    return _judged(ended, status, stderr)


def _judged(
    ended: subprocess.CompletedProcess[str], status: int | None, stderr: str | None
) -> subprocess.CompletedProcess[str]:
    """The process without the steps that it printed, if it ended so."""
    ended.stderr = without_steps(ended.stderr)
    assert status is None or ended.returncode == status, ended
    assert stderr is None or ended.stderr == stderr, ended
    return ended


def without_steps(stderr: str) -> str:
    """What a command printed on stderr, without the steps that it shows on a busy machine."""
    return "".join(line for line in stderr.splitlines(keepends=True) if not line.endswith(" ...\n"))


def designed(*arguments: str, cwd: Path, out: str = "out", command: list[str] = MODULE) -> Path:
    """Folder of a design that ``excite design ...`` made."""
    run("design", *arguments, "--out", out, cwd=cwd, command=command, status=0)
    return cwd / out


class Here:
    """Runs commands in this process.

    Parameters
    ----------
    cwd : Path
    monkeypatch, capfd
        Fixtures of pytest.
    """

    def __init__(self, cwd: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
        self.cwd, self.monkeypatch, self.capfd = cwd, monkeypatch, capfd

    def run(
        self, *arguments: str, status: int | None = None, stderr: str | None = None
    ) -> subprocess.CompletedProcess[str]:
        """Run ``excite ...`` to its end, which must be with this exit status and stderr, if they are given."""
        self.capfd.readouterr()
        self.monkeypatch.chdir(self.cwd)
        self.monkeypatch.setattr(sys, "argv", ["excite", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
        out, err = self.capfd.readouterr()
        assert isinstance(ended.value.code, int)
        return _judged(subprocess.CompletedProcess(list(arguments), ended.value.code, out, err), status, stderr)

    def refused(self, *arguments: str, status: int = 2) -> str:
        """The one line on stderr of a command that is refused, and that leaves all files as they were."""
        before = files_below(self.cwd)
        ended = self.run(*arguments)
        assert (ended.returncode, ended.stdout, ended.stderr.count("\n")) == (status, "", 1), ended
        assert ended.stderr.startswith("excite: ")
        assert files_below(self.cwd) == before
        return ended.stderr

    def designed(self, *arguments: str, out: str = "out") -> Path:
        """Folder of a design that ``excite design ...`` made."""
        self.run("design", *arguments, "--executor", "serial", "--out", out, status=0)
        return self.cwd / out


def module_of(file: Path) -> Any:
    """A script or an extension of the site, as a module that dataclasses find."""
    spec = importlib.util.spec_from_file_location(file.stem, file)
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules[file.stem] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def content_of(folder: Path) -> dict[str, Any]:
    """What ``design.json`` holds."""
    content = json.loads((folder / "design.json").read_text(encoding="utf-8"))
    assert isinstance(content, dict)
    return content


def table_of(path: Path) -> tuple[list[str], np.ndarray]:
    """Header and numbers of a CSV file, read by the standard library."""
    with path.open(newline="", encoding="utf-8") as stream:
        header, *rows = csv.reader(stream)
    return header, np.array([[float(cell) for cell in row] for row in rows])


def files_below(folder: Path) -> set[str]:
    """Every file and folder below one, hidden ones too, relative to it, but for Python's own bytecode."""
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if "__pycache__" not in path.parts}


def commands(group: click.Command = cli, words: tuple[str, ...] = ()) -> Iterator[tuple[str, click.Command]]:
    """Words and command, for every command that is no group."""
    if not isinstance(group, click.Group):
        yield " ".join(words), group
        return
    ctx = click.Context(group)
    for name in group.list_commands(ctx):
        command = group.get_command(ctx, name)
        assert command is not None
        yield from commands(command, (*words, name))


COMMANDS = dict(commands())
