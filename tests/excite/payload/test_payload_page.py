"""Every command of docs/payload.md works, in this order."""

from __future__ import annotations

import json
import re
import shlex
import sys
from pathlib import Path

import pytest

from excite.cli.main import main

PAGE = Path(__file__).parents[3] / "docs" / "payload.md"
BLOCKS = re.findall(r"```sh\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
COMMANDS = [line for block in BLOCKS for line in block.splitlines()]


@pytest.mark.slow
def test_every_command_of_the_page_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert len(COMMANDS) == 7
    for command in COMMANDS:
        monkeypatch.setattr(sys, "argv", shlex.split(command))
        with pytest.raises(SystemExit) as ended:
            main()
        beyond = "simulate" in command and "--load" in command  # the simulated controller does not know the load
        assert ended.value.code in ((0, None, 1) if beyond else (0, None)), command
    for folder, height in (("payload", 0.15 - 0.107), ("by-wrench", 0.15)):
        content = json.loads((tmp_path / folder / "payload.json").read_text(encoding="utf-8"))["payload"]
        low, high = content["mass"]["interval"]
        assert low <= 2.0 <= high
        assert abs(content["mass"]["value"] - 2.0) < 0.06
        assert content["centre"]["value"][2] == pytest.approx(height, abs=0.01)
