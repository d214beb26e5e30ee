"""Bodies that are only just possible are named."""

import numpy as np
import pytest

from excite.export.models.nearest_bodies import flat_bodies, flat_note
from regressors.robot.inertia import from_centre_of_mass


@pytest.mark.parametrize(
    ("size", "flat"),
    [((0.1, 0.2, 0.3), False), ((1.0, 1.0, 0.004), False), ((1.0, 1.0, 0.002), True), ((1.0, 0.001, 0.001), True)],
)
def test_boxes(size: tuple[float, ...], flat: bool) -> None:
    a, b, c = size
    tensor = 5.0 / 12.0 * np.diag([b * b + c * c, a * a + c * c, a * a + b * b])
    body = from_centre_of_mass(5.0, np.array([0.3, -0.1, 0.7]), tensor)
    assert flat_bodies({"box": body}) == (("box",) if flat else ())
    assert ("box" in "".join(flat_note({"box": body, "cube": body}))) == flat
