"""The examples as a gallery, and a notebook as a page, from what was recorded when they ran; nothing runs here.

A block ``{gallery}`` with names of scripts in ``docs/examples``, one on each line, becomes a card for each, with its
figure, title and sentence, which leads to a page with the script, its figure and what it prints. These pages are
written to ``docs/gallery``, which git ignores, before Sphinx looks for pages. A block ``{notebook} FILE`` becomes the
notebook's text, code and outputs.
"""

from __future__ import annotations

import ast
import base64
import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

DOCS = Path(__file__).resolve().parents[1]
EXAMPLES, PAGES = DOCS / "examples", DOCS / "gallery"
GALLERY = re.compile(r"^```\{gallery\}\n((?:\w+\n)+)```$", re.MULTILINE)
NOTEBOOK = re.compile(r"^```\{notebook\} (\S+)\n```$", re.MULTILINE)


@dataclass(frozen=True)
class Example:
    """A script with its docstring ``TITLE: SENTENCE``, further paragraphs below.

    Parameters
    ----------
    name : str
        Of the file, without its ending.
    title, sentence, text : str
    """

    name: str
    title: str
    sentence: str
    text: str

    @classmethod
    def of(cls, name: str) -> Example:
        """Read a script.

        Raises
        ------
        ExtensionError
            No such script, no docstring of this form, or no recorded figure and output.
        """
        files = (EXAMPLES / f"{name}.py", figure_of(name), printed_by(name))
        for file in files:
            if not file.is_file():
                raise ExtensionError(f"{file} is missing; python docs/draw_gallery.py {name} writes figure and output")
        text = ast.get_docstring(ast.parse(files[0].read_text(encoding="utf-8"))) or ""
        parts = re.match(r"([^:?]+)(?:: |(?<=.)(\?) )(.+?)\n(?:\n(.*))?\Z", f"{text}\n", re.DOTALL)
        if parts is None:
            raise ExtensionError(f"{files[0]}: expected a docstring that begins with TITLE: SENTENCE")
        title, mark, sentence, more = parts.groups()
        return cls(name, title + (mark or ""), sentence[0].upper() + sentence[1:], (more or "").strip())


def figure_of(name: str) -> Path:
    """Recorded figure of a script."""
    return EXAMPLES / "figures" / f"{name}.png"


def printed_by(name: str) -> Path:
    """Recorded output of a script."""
    return EXAMPLES / "printed" / f"{name}.txt"


def names_in(text: str) -> list[str]:
    """Names of scripts in all galleries of a text."""
    return [name for block in GALLERY.findall(text) for name in block.split()]


def card(example: Example) -> str:
    """Figure, title and sentence, which lead to the page."""
    page, sentence = f"gallery/{example.name}.rst", example.sentence.replace("``", "`")
    return (
        f"````{{container}} example\n[![{example.title}](examples/figures/{example.name}.png)]({page})\n\n"
        f"**[{example.title}]({page})**\n\n{sentence}\n````\n"
    )


def page(example: Example) -> str:
    """Page of one script, in reStructuredText as docstrings are."""
    name = example.name
    return f"""{example.title}
{"=" * len(example.title)}

{example.sentence}

{example.text}

.. image:: ../examples/figures/{name}.png
   :alt: Figure that the script draws
   :class: example-figure

It prints:

.. literalinclude:: ../examples/printed/{name}.txt
   :language: text

:download:`{name}.py <../examples/{name}.py>`; an argument is the folder for the figure:

.. literalinclude:: ../examples/{name}.py
   :language: python
{"".join(map(beside, files_named(example.text)))}"""


def files_named(text: str) -> list[str]:
    """Files beside a script that its docstring names."""
    return [name for name in re.findall(r"``([\w.]+)``", text) if (EXAMPLES / name).is_file()]


def beside(name: str) -> str:
    """Text of a file that a script reads."""
    return f"\n:download:`{name} <../examples/{name}>`:\n\n.. literalinclude:: ../examples/{name}\n   :language: yaml\n"


def write(folder: Path, names: list[str]) -> None:
    """Write the pages of scripts, and remove those of scripts that are no more."""
    folder.mkdir(exist_ok=True)
    texts = {f"{name}.rst": page(Example.of(name)) for name in names}
    for old in folder.glob("*.rst"):
        if old.name not in texts:
            old.unlink()
    for name, text in texts.items():
        file = folder / name
        if not file.exists() or file.read_text(encoding="utf-8") != text:
            file.write_text(text, encoding="utf-8")


def notebook_page(file: Path, images: Path) -> str:
    """Cells of a notebook in Markdown; images of its outputs are written into a folder.

    Parameters
    ----------
    file, images : Path
    """
    parts = []
    for number, cell in enumerate(json.loads(file.read_text(encoding="utf-8"))["cells"]):
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(source)
            continue
        parts.append(f"```python\n{source}\n```")
        parts += [_output(each, images / f"{file.stem}-{number}") for each in cell["outputs"]]
    return "\n\n".join(parts)


def _output(output: dict[str, Any], image: Path) -> str:
    """What a cell has printed, shown or drawn."""
    data = output.get("data", {})
    if "image/png" in data:
        image.parent.mkdir(exist_ok=True)
        image.with_suffix(".png").write_bytes(base64.b64decode("".join(data["image/png"])))
        return f"![Figure that the cell above draws]({image.parent.name}/{image.name}.png)"
    if "text/html" in data:
        return f"```{{raw}} html\n{''.join(data['text/html'])}\n```"
    text = "".join(output.get("text", data.get("text/plain", "")))
    return f"```text\n{text.rstrip()}\n```"


def _read(app: Sphinx, docname: str, source: list[str]) -> None:
    path = Path(app.env.doc2path(docname))
    if path.suffix != ".md":
        return
    source[0] = GALLERY.sub(
        lambda block: (
            "`````{container} examples\n"
            + "\n".join(card(Example.of(name)) for name in block[1].split())
            + "`````\n\n```{toctree}\n:hidden:\n\n"
            + "".join(f"gallery/{name}\n" for name in block[1].split())
            + "```"
        ),
        source[0],
    )
    for name in NOTEBOOK.findall(source[0]):
        app.env.note_dependency(str(path.parent / name))
    source[0] = NOTEBOOK.sub(lambda block: notebook_page(path.parent / block[1], PAGES), source[0])


def setup(app: Sphinx) -> dict[str, bool]:
    """Write the pages, and expand the blocks as pages are read."""
    write(PAGES, names_in((DOCS / "examples.md").read_text(encoding="utf-8")))
    app.connect("source-read", _read)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
