"""Numbers of a description whose products no float can hold: one error, and no warning of NumPy."""

import pytest

from regressors.errors import InputError
from regressors.readers.library import load_robot

ROBOT = """
name: one
joints: [{{name: a, mdh: {{}}, limits: {{position: [-1, 1], velocity: 1, acceleration: 1}}}}]
links: [{{name: A, mass: {mass}, com: [{com}, 0.1, 0.1], inertia: {{about: {about}, xx: 1, yy: 1, zz: 1}}}}]
"""


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("about", ["centre-of-mass", "origin"])
@pytest.mark.parametrize(("mass", "com"), [("1e200", "1e200"), ("2.0", "1e308")])
def test_products_beyond_floats_are_refused(mass: str, com: str, about: str, tmp_path) -> None:
    path = tmp_path / "one.yaml"
    path.write_text(ROBOT.format(mass=mass, com=com, about=about))
    with pytest.raises(InputError, match="link 'A': inertial parameters must be finite"):
        load_robot(path)
