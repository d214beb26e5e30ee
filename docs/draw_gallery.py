"""Run the examples, and record what they draw and print: ``python docs/draw_gallery.py [--logs LOGS] [NAME ...]``.

Without names all of them run, which takes some three minutes. LOGS is the folder with the logs of the UR10e, which are
not part of the repository; without it, what was recorded of that example stays.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

EXAMPLES = Path(__file__).resolve().parent / "examples"
OF_LOGS = "real_ur10e"
STATED = re.compile(r"Takes about (\d+) s\.")


def arguments_of(name: str, logs: Path | None) -> list[str] | None:
    """Arguments of a script before the folder of its figure; None if it cannot run."""
    if name != OF_LOGS:
        return []
    return None if logs is None else [str(logs.resolve())]


def record(name: str, arguments: list[str]) -> None:
    """Run one script, and keep its figure and output.

    Raises
    ------
    SystemExit
        It failed, or took far longer or shorter than its docstring says.
    """
    script = EXAMPLES / f"{name}.py"
    with tempfile.TemporaryDirectory(dir=EXAMPLES) as folder:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [sys.executable, str(script), *arguments, folder]
        ended = subprocess.run(command, capture_output=True, text=True, check=False)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        if ended.returncode:
            raise SystemExit(f"{script} failed:\n{ended.stderr}")
        printed = Path(folder) / f"{name}.txt"
        printed.write_text(ended.stdout, encoding="utf-8")
        for file, kept in ((printed, "printed"), (printed.with_suffix(".png"), "figures")):
            (EXAMPLES / kept).mkdir(exist_ok=True)
            os.replace(file, EXAMPLES / kept / file.name)
    took = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    (stated,) = STATED.findall(script.read_text(encoding="utf-8"))
    print(f"{name}: {took:.0f} s of processor time")
    if not 0.5 < took / float(stated) < 2.0:
        raise SystemExit(f"{script} takes about {took:.0f} s; its docstring says {stated} s")


def main() -> None:
    """Record all examples, or those that are named."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--logs", type=Path)
    given = parser.parse_args()
    for name in given.names or sorted(path.stem for path in EXAMPLES.glob("*.py")):
        arguments = arguments_of(name, given.logs)
        if arguments is None:
            print(f"{name}: needs --logs, not run")
        else:
            record(name, arguments)


if __name__ == "__main__":
    main()
