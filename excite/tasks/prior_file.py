"""Prior knowledge of parameters, from files."""

from __future__ import annotations

from pathlib import Path

from regressors.quantities import fault as fault_of
from regressors.readers.documents import described, read_document

_KEYS = ("value", "deviation")


def read_prior(path: Path) -> dict[str, dict[str, float]]:
    """Read values and standard deviations from a file such as ``X7: {value: 8.125, deviation: 0.5}``, in SI."""
    document = read_document(path, "prior file")
    assert isinstance(document.content, dict)
    problems = {name: fault(known) for name, known in document.content.items()}
    if any(problems.values()):
        raise document.error(((name,), what) for name, what in problems.items() if what)
    return {name: {key: float(known[key]) for key in _KEYS} for name, known in document.content.items()}


def known_beforehand(prior: object) -> object:
    """Check the entry ``prior`` of a task file: a relative uncertainty, or parameters as in a prior file."""
    if isinstance(prior, int | float) and not isinstance(prior, bool):
        if (wrong := fault_of("prior", prior)) is not None:
            raise ValueError(wrong)
        return prior
    if not isinstance(prior, dict):
        raise ValueError(f"expected a relative uncertainty or a mapping of parameters, given {described(prior)}")
    for name, known in prior.items():
        if what := fault(known):
            raise ValueError(f"{name}: {what}")
    return prior


def fault(known: object) -> str:
    """Problem with one parameter's entry as text; empty if it is valid."""
    if isinstance(known, dict) and set(known) == set(_KEYS) and all(isinstance(known[k], int | float) for k in _KEYS):
        wrong = ((key, fault_of(f"prior_{key}", known[key])) for key in _KEYS)
        return next((f"{key} {what}" for key, what in wrong if what is not None), "")
    given = f"a mapping of {', '.join(map(str, known))}" if isinstance(known, dict) else described(known)
    return f"expected finite numbers {{value: ..., deviation: ...}}, given {given}"
