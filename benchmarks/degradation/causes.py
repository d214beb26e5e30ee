"""Whether a message names the cause of a bad result: by its words, if an undegraded log does not have it too."""

from __future__ import annotations

import re
from collections.abc import Iterable

WORDS = {
    "clock jitter": r"clock|stamp|jitter|irregular",
    "held rows": r"\bheld\b|repeat",
    "quantisation": r"quanti|resolution|\bsteps? of|counts",
    "white noise": r"noise",
    "coloured noise": r"noise|correlated",
    "delay": r"delay|\blate|\blag",
    "dropped rows": r"\bgaps?\b|missing|dropped",
    "impacts": r"impact|jump|collision|outlier",
    "wrong gains": r"\bgains?\b",
    "friction drift": r"drift|temperature|warm",
    "sticking": r"stick|stiction|presliding|standstill",
    "payload forgotten": r"payload|\bload\b",
    "host": r"clock|stamp|jitter|irregular|\bheld\b|repeat|quanti|resolution|delay",
}


NO_CAUSE = r"taken as true|^Coulomb friction"  # statements of what was assumed or chosen


def naming(kind: str, messages: Iterable[str], usual: Iterable[str]) -> list[str]:
    """Messages that name the cause.

    Parameters
    ----------
    kind : str
        Of the degradation.
    messages : iterable of str
    usual : iterable of str
        Messages of the same robot without degradation.
    """
    known = {_bare(text) for text in usual}
    pattern = WORDS.get(kind)
    if pattern is None:
        return []
    stated = [text for text in messages if _bare(text) not in known and not re.search(NO_CAUSE, text)]
    return [text for text in stated if re.search(pattern, text, re.IGNORECASE)]


def _bare(text: str) -> str:
    """Without numbers."""
    return re.sub(r"[-+]?\d[\d.e+-]*", "#", text)
