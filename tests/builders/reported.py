"""Small results of every kind to report on, with names that would be markup if they were not escaped."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import excite
from excite.files.world_file import world_of

HOSTILE = "<script>document.title='run'</script> \"quoted\" 'twice' & `code`"
WORLD = {
    "clearance": 0.01,
    "robot": [
        {"link": "arm", "from": [0, 0, 0], "to": [0.45, 0, 0], "radius": 0.08},
        {"link": "forearm", "from": [0, 0, 0], "to": [0.6, 0, 0], "radius": 0.07},
    ],
    "objects": {
        "floor": {"plane": {"normal": [0, 0, 1], "offset": -0.5}},
        HOSTILE: {"box": {"centre": [1.6, 0.9, 0.3], "size": [0.3, 0.3, 0.6]}},
        "post": {"capsule": {"from": [-1.5, -1.2, -0.4], "to": [-1.5, -1.2, 1.0], "radius": 0.08}},
    },
}


@cache
def reported_design() -> excite.Design:
    """A motion from home and back between objects."""
    return excite.design_trajectory(
        "irp6",
        trajectory=excite.TrajectoryChoice(harmonics=2, period=4.0),
        search=excite.Search(starts=1, executor="serial"),
        output=excite.Output(rate=25.0, home=(0.0, 0.1, -0.1, 0.0, 0.0), settle=0.2),
        limits=excite.LimitChoice(world=world_of(WORLD)),
    )


@dataclass(frozen=True)
class Element:
    """An element of a page, with the text in it and below it."""

    tag: str
    attributes: dict[str, str | None]
    text: list[str]


class ParsedPage(HTMLParser):
    """Elements of a page in their order."""

    _VOID = ("meta", "link", "input", "img", "br")

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[Element] = []
        self._open: list[Element] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        element = Element(tag, dict(attrs), [])
        self.elements.append(element)
        if tag not in self._VOID:
            self._open.append(element)

    def handle_endtag(self, tag: str) -> None:
        while self._open and self._open.pop().tag != tag:
            pass

    def handle_data(self, data: str) -> None:
        for element in self._open:
            element.text.append(data)

    def of(self, tag: str) -> list[Element]:
        """Elements of a kind."""
        return [each for each in self.elements if each.tag == tag]

    def numbers(self, name: str) -> list[list[float]]:
        """Exact numbers of the rows of the first table of a name."""
        begin = next(k for k, each in enumerate(self.elements) if each.attributes.get("data-table") == name)
        end = next((k for k in range(begin + 1, len(self.elements)) if self.elements[k].tag == "table"), None)
        rows: list[list[float]] = []
        for each in self.elements[begin:end]:
            if each.tag == "tr":
                rows.append([])
            elif each.tag in ("td", "th") and "data-value" in each.attributes:
                rows[-1].append(float(str(each.attributes["data-value"])))
        return rows[1:]


def saved(folder: Path, result: Any) -> Path:
    """The folder that a result is saved to."""
    result.save(folder)
    return folder
