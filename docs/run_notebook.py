"""Make the notebooks of the examples from their sources, and run them: ``python docs/run_notebook.py``.

Each source in ``docs/examples/notebook`` is a Python file with cells after ``# %%``, and Markdown after
``# %% [markdown]``, as editors and Jupytext know them. The notebook beside the examples has its outputs; it needs
nbclient and ipykernel, of the extra ``docs``.
"""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Any

EXAMPLES = Path(__file__).resolve().parent / "examples"
SOURCES = EXAMPLES / "notebook"
INLINE = "module://matplotlib_inline.backend_inline"
_CELL = re.compile(r"^# %%( \[markdown\])?\n", re.MULTILINE)


def cells_of(source: str) -> list[tuple[str, str]]:
    """Kind and text of each cell of a source; kinds are ``code`` and ``markdown``."""
    _, *parts = _CELL.split(source)
    kinds, texts = parts[::2], (text.strip("\n") for text in parts[1::2])
    return [
        ("markdown", re.sub(r"^# ?", "", text, flags=re.MULTILINE)) if kind else ("code", text)
        for kind, text in zip(kinds, texts, strict=True)
    ]


def executed(source: Path) -> Any:
    """Notebook of a source, with its outputs, and without anything that differs from run to run."""
    import nbclient
    import nbformat

    made = nbformat.v4.new_notebook(metadata={"language_info": {"name": "python"}})
    kinds = {"markdown": nbformat.v4.new_markdown_cell, "code": nbformat.v4.new_code_cell}
    for number, (kind, text) in enumerate(cells_of(source.read_text(encoding="utf-8"))):
        made.cells.append(kinds[kind](text, id=f"cell-{number}"))
    environment = {**os.environ, "MPLBACKEND": INLINE}
    client = nbclient.NotebookClient(made, timeout=300, kernel_name="python3", record_timing=False)
    client.execute(cwd=str(source.parent), env=environment)
    made.metadata = nbformat.from_dict(
        {
            "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
            "language_info": {"name": "python"},
        }
    )
    return made


def main() -> None:
    """Write all notebooks."""
    for source in sorted(SOURCES.glob("*.py")):
        notebook = executed(source)
        file = EXAMPLES / f"{source.stem}.ipynb"
        temporary = file.with_suffix(".ipynb~")
        temporary.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        os.replace(temporary, file)
        print(f"{file.name}: {file.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
