"""The HTML of a page, from its sections: every text escaped, nothing from elsewhere."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from excite.report.drawings import dark_rules
from excite.report.sections import ReportSection
from regressors.quoting import printable

_PAGE = Path(__file__).parent / "page"
_CODE = re.compile(r"`([^`]+)`")
_UNSAFE = {"<": "\\u003c", ">": "\\u003e", "&": "\\u0026", "\u2028": "\\u2028", "\u2029": "\\u2029"}


def page_text(sections: Sequence[ReportSection]) -> str:
    """One HTML page.

    Scripts and styles are in the page, and its content policy allows these alone, by their hashes: no others, no
    network, no frames, no forms.
    """
    moves = any(section.motion is not None for section in sections)
    scripts = [_asset("tables.js"), *([_asset("player.min.js")] if moves else [])]
    style = _asset("style.css") + dark_rules(figure.svg for section in sections for figure in section.figures)
    page: str = _template().render(
        sections=sections,
        motions=[None if each.motion is None else _data(each.motion) for each in sections],
        policy=_policy(scripts, style),
        scripts=scripts,
        style=style,
        licence=_asset("three.LICENSE") if moves else "",
        version=version("excite-trajectories"),
        date=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
    )
    return page


def _template() -> Any:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(_PAGE), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.finalize = _literal
    environment.filters["code"] = _with_code
    return environment.get_template("page.html")


def _literal(value: Any) -> Any:
    """Text whose lines hold no control characters; what is markup or a number as it is."""
    return "\n".join(map(printable, value.split("\n"))) if type(value) is str else value


def _asset(name: str) -> str:
    return (_PAGE / name).read_text(encoding="utf-8")


def _policy(scripts: Sequence[str], style: str) -> str:
    """Content policy that allows these scripts, this style, and pictures in the page."""
    allowed = " ".join(_hash(script) for script in scripts)
    return (
        f"default-src 'none'; script-src {allowed}; style-src {_hash(style)}; img-src data:; base-uri 'none'; "
        "form-action 'none'"
    )


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode('ascii')}'"


def _data(motion: Any) -> str:
    """JSON that cannot end the element that it stands in."""
    text = json.dumps(motion, allow_nan=False, separators=(",", ":"))
    return "".join(_UNSAFE.get(letter, letter) for letter in text) if any(map(text.__contains__, _UNSAFE)) else text


def _with_code(text: str) -> Any:
    """Options in backticks as code, everything escaped."""
    from markupsafe import Markup, escape

    parts = _CODE.split(printable(text))
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if k % 2 else escape(part) for k, part in enumerate(parts)
    )
