"""Families that are not linear in their parameters beside the Fourier series, on the problems of `families.py`."""

from __future__ import annotations

from typing import Any

import families
import record

FAMILIES: dict[str, dict[str, Any]] = {
    "fourier": {"trajectory": "fourier"},
    "waypoints": {"trajectory": "waypoints", "intervals": 3},
    "sines": {"trajectory": "sines", "harmonics": 2},
}
LIMITATIONS = (
    *families.LIMITATIONS[:1],
    "the smaller number of coefficients of `families.py` only, or the next that the family can have; the times of the "
    "waypoints, shared by all joints, and the frequencies of the sines come on top of the coefficients",
    families.LIMITATIONS[-1],
)


def main() -> None:
    """Every robot, every family."""
    before = record.load()
    families.FAMILIES.clear()
    families.FAMILIES.update(FAMILIES)
    found: dict[str, list[dict[str, Any]]] = {}
    text = []
    for key, setting in families.SETTINGS.items():
        smaller = [(name, task) for name, wanted, task in families.tasks(setting) if wanted == setting.sizes[0]]
        found[key] = [{"family": name, **families.designed(setting, task)} for name, task in smaller]
        rows = [families.row(one["family"], one) for one in found[key]]
        text.append(f"{setting.title}\n\n{record.table(families.HEAD, rows)}")
        print(text[-1], flush=True)
    content = {"starts": families.STARTS, "seed": families.SEED, "robots": found}
    record.save("curved_families", before, content, "\n\n".join(text), LIMITATIONS)


if __name__ == "__main__":
    main()
