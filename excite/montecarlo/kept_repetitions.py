"""Repetitions in a file, so that the same call goes on with the rest after its workers were lost or it was killed."""

from __future__ import annotations

import hashlib
import json
import logging
import time
import zipfile
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path

import numpy as np

from excite.design.own_code import NotComparable, plain_value
from excite.design.problem_identity import PACKAGES
from excite.montecarlo.repetition_units import SeededExperiment
from excite.montecarlo.repetitions import Repetition
from excite.storage.atomic import replacing
from regressors.input_files import LOG, opened

_EVERY = 5.0  # seconds between two writes

_UNREADABLE = (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile)
_log = logging.getLogger(__name__)


class KeptRepetitions:
    """A file with the repetitions of an experiment that are computed."""

    def __init__(self, path: Path, common: SeededExperiment) -> None:
        self.path, self._identity = path, _identity(common)
        self._next = time.monotonic() + _EVERY

    def read(self, count: int) -> dict[int, Repetition]:
        """Repetitions of numbers below ``count`` that are in the file; none where there is no file."""
        if not self._identity or not self.path.exists():
            return {}
        try:
            with opened(self.path, LOG) as stream, np.load(stream, allow_pickle=False) as content:
                identity, numbers = str(content["identity"]), content["number"].tolist()
                rows = zip(content["error"], content["deviation"], content["noise"], strict=True)
                found = {number: Repetition(*row) for number, row in zip(numbers, rows, strict=True)}
        except _UNREADABLE:
            _log.warning("%s cannot be read; its repetitions are computed again", self.path)
            return {}
        if identity != self._identity:
            _log.warning("%s is of another experiment, and is replaced", self.path)
            return {}
        found = {number: one for number, one in found.items() if number < count}
        _log.info("%d of %d repetitions are already done in %s", len(found), count, self.path)
        return found

    def save(self, repetitions: Mapping[int, Repetition], *, now: bool = False) -> bool:
        """Write them, not more often than every few seconds if not ``now``; say whether they can be used later."""
        if not self._identity or not repetitions:
            return False
        if now or time.monotonic() >= self._next:
            error, deviation, noise = (np.array(part) for part in zip(*repetitions.values(), strict=True))
            identity, number = np.array(self._identity), np.array(list(repetitions))
            with replacing(self.path, "wb") as stream:
                np.savez(stream, identity=identity, number=number, error=error, deviation=deviation, noise=noise)
            self._next = time.monotonic() + _EVERY
        return True

    def remove(self) -> None:
        """Remove the file."""
        self.path.unlink(missing_ok=True)


def _identity(common: SeededExperiment) -> str:
    """Hash of what repetitions depend on; empty where a later process could not tell whether it is the same."""
    try:
        content = [plain_value(common.experiment), common.seed, {name: version(name) for name in PACKAGES}]
    except NotComparable:
        return ""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
