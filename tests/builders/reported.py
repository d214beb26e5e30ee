"""Small results to report on, with names that would be markup, and their pages: parsed, or in a headless browser."""

from __future__ import annotations

import fcntl
import itertools
import json
import os
import select
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

import excite
from constraints.world_file import world_of

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


CHROMIUM = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None
)
_FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-gpu-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--hide-scrollbars", "--remote-debugging-pipe",
)  # fmt: skip
_PATIENCE = 60.0  # s for one answer


class Page:
    """One page of the browser.

    Attributes
    ----------
    errors : list of str
        Messages of the console that are errors or warnings, exceptions, and breaches of the content policy.
    requests : list of str
        Addresses that the page asked for.
    """

    def __init__(self, to_browser: int, from_browser: int) -> None:
        self._out, self._in, self._rest, self._count = to_browser, from_browser, b"", 0
        self._session: str | None = None
        self.errors: list[str] = []
        self.requests: list[str] = []
        self.loaded = False
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Result of a method of the DevTools protocol."""
        self._count += 1
        message = {"id": self._count, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        os.write(self._out, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._message()
            if answer.get("id") == self._count:
                assert "error" not in answer, (method, answer["error"])
                return dict(answer["result"])

    def _message(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            assert select.select([self._in], [], [], _PATIENCE)[0], "the browser does not answer"
            read = os.read(self._in, 1 << 20)
            assert read, "the browser has ended"
            self._rest += read
        text, _, self._rest = self._rest.partition(b"\0")
        message: dict[str, Any] = json.loads(text)
        self._note(message.get("method", ""), message.get("params", {}))
        return message

    def _note(self, event: str, given: dict[str, Any]) -> None:
        if event == "Page.loadEventFired":
            self.loaded = True
        elif event == "Network.requestWillBeSent":
            self.requests.append(given["request"]["url"])
        elif event == "Runtime.exceptionThrown":
            self.errors.append(str(given["exceptionDetails"]))
        elif event == "Runtime.consoleAPICalled" and given["type"] in ("error", "warning", "assert"):
            self.errors.append(str(given["args"]))
        elif event == "Log.entryAdded" and given["entry"]["level"] in ("error", "warning"):
            self.errors.append(given["entry"]["text"])

    def open(self, path: Path) -> float:
        """Open a file, and wait until it is loaded; returns how long it took [s]."""
        self.loaded, begin = False, time.monotonic()
        self.call("Page.navigate", url=path.resolve().as_uri())
        while not self.loaded:
            self._message()
        return time.monotonic() - begin

    def value(self, expression: str) -> Any:
        """Value of an expression of JavaScript in the page."""
        result = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in result, result
        return result["result"].get("value")

    def press(self, key: str) -> None:
        """Press a key."""
        text = {"text": key} if len(key) == 1 else {}
        self.call("Input.dispatchKeyEvent", type="keyDown", key=key, **text)
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key)


@contextmanager
def browser_page() -> Iterator[Page]:
    """A page of a new browser, which ends with the block."""
    assert CHROMIUM is not None
    with TemporaryDirectory(ignore_cleanup_errors=True) as profile:  # children of the browser may write for longer
        pairs = [os.pipe(), os.pipe()]
        (theirs_in, to_browser), (from_browser, theirs_out) = pairs
        high = [fcntl.fcntl(fd, fcntl.F_DUPFD, 20) for fd in (theirs_in, theirs_out)]
        command = f'exec "$0" "$@" 3<&{high[0]} 4>&{high[1]}'
        words = ["bash", "-c", command, CHROMIUM, *_FLAGS, f"--user-data-dir={profile}"]
        process = subprocess.Popen(words, pass_fds=high, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
        for fd in (*high, theirs_in, theirs_out):
            os.close(fd)
        try:
            yield Page(to_browser, from_browser)
        finally:
            process.terminate()
            process.wait(10)
            os.close(to_browser)
            os.close(from_browser)


def misplaced(figure: Figure) -> list[str | tuple[str, str]]:
    """Texts of a figure that reach out of it, and pairs of texts that overlap."""
    figure.draw_without_rendering()
    frame, boxes = figure.bbox.padded(1.0), {text: _box_of(text) for text in _seen(figure)}
    outside = [
        text.get_text()
        for text, box in boxes.items()
        if not (frame.contains(box.x0, box.y0) and frame.contains(box.x1, box.y1))
    ]
    pairs = itertools.combinations(boxes, 2)
    return [*outside, *((a.get_text(), b.get_text()) for a, b in pairs if boxes[a].overlaps(boxes[b]))]


def _box_of(text: Text) -> Bbox:
    """Where a text is drawn, without the empty lines at its end."""
    box, whole = text.get_window_extent(), text.get_text()
    text.set_text(whole.rstrip("\n"))
    height = text.get_window_extent().height
    text.set_text(whole)
    return Bbox([[box.x0, box.y1 - height], [box.x1, box.y1]])


def _seen(figure: Figure) -> list[Text]:
    """Every text that is drawn: of ticks only those in view."""
    hidden: set[Text] = set()
    for ax in figure.axes:
        for axis, (low, high) in ((ax.xaxis, sorted(ax.get_xlim())), (ax.yaxis, sorted(ax.get_ylim()))):
            hidden |= {label for tick in axis.get_minor_ticks() for label in (tick.label1, tick.label2)}
            for tick in axis.get_major_ticks():
                hidden |= {tick.label2} if low <= tick.get_loc() <= high else {tick.label1, tick.label2}
    return [
        text for text in figure.findobj(Text) if text.get_text().strip() and text.get_visible() and text not in hidden
    ]
