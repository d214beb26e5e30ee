"""Named ways to mount a base."""

from __future__ import annotations

import math

MOUNTS: dict[str, tuple[float, float, float]] = {  # roll, pitch and yaw of the base [rad]
    "floor": (0.0, 0.0, 0.0),
    "wall": (0.0, math.pi / 2, 0.0),
    "ceiling": (math.pi, 0.0, 0.0),
}
