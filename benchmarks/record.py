"""Results as files: ``results/NAME.json``, and the same as text in ``results/NAME.md``.

The pages of the studies have the text too, between markers; the page of claims has short tables of its own (`claims`).
Run alone, it writes them all anew from the files.
"""

from __future__ import annotations

import json
import os
import platform
import re
import sys
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import claims
from measure import HERE

_PACKAGES = ("excite-trajectories", "casadi", "numpy", "scipy", "daqp", "pin", "example-robot-data")


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    names = re.findall(r"^model name\s*:\s*(.+)$", info.read_text(), re.MULTILINE) if info.exists() else []
    return names[0] if names else platform.machine()


def load() -> float:
    """Mean number of running processes over the last minute."""
    return round(os.getloadavg()[0], 2)


def table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)


def command() -> str:
    """The command that is running, as in a fresh clone."""
    script = Path(sys.argv[0]).resolve()
    place = script.relative_to(HERE) if script.is_relative_to(HERE) else script.name
    return " ".join([".venv/bin/python", f"benchmarks/{place}", *sys.argv[1:]])


def _json(document: Mapping[str, Any]) -> str:
    """Indented, but with every list of plain values on one line."""
    text = json.dumps(document, indent=1)
    return re.sub(r"\[\s+([^\[\]{}]*?)\s+\]", lambda found: "[" + " ".join(found[1].split()) + "]", text) + "\n"


def save(
    name: str,
    load_before: float,
    content: Mapping[str, Any],
    text: str,
    limitations: Sequence[str],
    folder: Path = HERE,
) -> None:
    """Write a benchmark's files, bring the README up to date, and print the text.

    Parameters
    ----------
    name : str
    load_before : float
        `load` when the benchmark began.
    content : mapping
        Everything measured, for JSON.
    text : str
        The tables.
    limitations : sequence of str
        What the numbers do not say.
    folder : Path
        With the README, and the folder ``results``.
    """
    environment = {
        "date": datetime.now(UTC).date().isoformat(),
        "processor": f"{os.cpu_count()} cores, {_processor()}",
        "load_before_and_after": [load_before, load()],
        "python": platform.python_version(),
        "versions": {package: version(package) for package in _PACKAGES},
    }
    document = {"command": command(), "environment": environment, "limitations": list(limitations), **content}
    (folder / "results").mkdir(parents=True, exist_ok=True)
    _write(folder / "results" / f"{name}.json", _json(document))
    made = (
        f"`{command()}`, {environment['date']}, {environment['processor']}, load {load_before} before, {load()} after"
    )
    notes = "\n".join(f"- {limitation}" for limitation in limitations)
    body = f"{text}\n\nMade by {made}.\n\nLimitations:\n\n{notes}\n"
    _write(folder / "results" / f"{name}.md", body)
    _into_readme(name, body, folder)
    _refresh_claims()
    print(body)


def _write(path: Path, text: str) -> None:
    beside = path.with_suffix(".tmp")
    beside.write_text(text, encoding="utf-8")
    beside.replace(path)


def _refresh_claims() -> None:
    page = HERE / "README.md"
    _write(page, claims.filled(page.read_text(encoding="utf-8")))


def _into_readme(name: str, body: str, folder: Path) -> None:
    readme = folder / "README.md"
    if folder == HERE or not readme.exists():  # the page of claims, or results of a folder elsewhere
        return
    begin, end = f"<!-- {name} -->", f"<!-- end of {name} -->"
    parts = re.compile(f"{re.escape(begin)}.*?{re.escape(end)}", re.DOTALL)
    text = readme.read_text(encoding="utf-8")
    _write(readme, parts.sub(lambda _: f"{begin}\n{body}{end}", text))


if __name__ == "__main__":
    named = ("accuracy", "coverage", "degradation", "identification", "real", "repetitions")
    for folder in (HERE / name for name in named):
        for file in sorted((folder / "results").glob("*.md")):
            _into_readme(file.stem, file.read_text(encoding="utf-8"), folder)
    _refresh_claims()
