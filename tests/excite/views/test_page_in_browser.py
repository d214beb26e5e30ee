"""Pages in a headless Chromium: no error, no request, the player moves as the robot does, tables sort."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from processes import until
from public_arms import ARMS
from reported import CHROMIUM, Page, browser_page, reported_design
from written_results import result

import excite
from constraints.clearance import link_poses

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on the path; Debian's package is chromium"),
]
DARK = [{"name": "prefers-color-scheme", "value": "dark"}]
MOST_BYTES = 3_000_000


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return excite.write_report([reported_design(), result("old")], tmp_path_factory.mktemp("page") / "page.html")


@pytest.fixture(scope="module")
def browser() -> Iterator[Page]:
    with browser_page() as page:
        yield page


@pytest.fixture
def page(browser: Page, path: Path) -> Page:
    browser.errors.clear()
    browser.requests.clear()
    browser.call("Emulation.setDeviceMetricsOverride", width=1280, height=900, deviceScaleFactor=1, mobile=False)
    browser.open(path)
    browser.value("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
    browser.value("new Promise((done) => setTimeout(done, 500))")  # the view comes when it is seen
    return browser


def test_nothing_fails_and_nothing_is_asked_of_the_network(page: Page, path: Path) -> None:
    page.value("exciteReport.players[0].seek(1)")
    page.value("document.querySelectorAll('.player')[1].scrollIntoView()")
    page.call("Emulation.setEmulatedMedia", features=DARK)
    until(lambda: page.value("document.querySelectorAll('.stage canvas').length") == 2)  # WebGL is there
    assert page.errors == []
    assert {url for url in page.requests if not url.startswith("data:")} == {path.resolve().as_uri()}


def test_other_scripts_and_other_hosts_are_refused(page: Page) -> None:
    script = "Object.assign(document.createElement('script'), {textContent: 'window.ran = 1'})"
    page.value(f"document.body.append({script})")
    page.value("fetch('http://127.0.0.1:9/').catch(() => null)")
    assert page.value("window.ran === undefined")
    assert any("Content Security Policy" in error for error in page.errors)


def test_player_moves_as_the_robot_does(page: Page) -> None:
    design = reported_design()
    robot, (samples, _) = design.robot, design.sequence.sampled()
    last = []
    for time in (0.3, 1.37, float(samples.time[-1])):
        page.value(f"exciteReport.players[0].seek({time})")
        poses = page.value("exciteReport.players[0].pose()")
        q = np.array([[np.interp(time, samples.time, samples.q[:, k]) for k in range(robot.n)]])
        for name, pose in link_poses(robot, q).items():
            if name in poses:  # the base does not move
                np.testing.assert_allclose(np.reshape(poses[name], (4, 4)), pose[0], atol=2e-3)
        last.append(poses[robot.links[-1].name])
    assert np.abs(np.subtract(last[0], last[1])).max() > 0.01
    at_sample = float(samples.time[40])
    page.value(f"exciteReport.players[0].seek({at_sample!r})")
    last_link = robot.links[-1].name
    shown = np.reshape(page.value("exciteReport.players[0].pose()")[last_link], (4, 4))
    np.testing.assert_allclose(shown, link_poses(robot, samples.q[40:41])[last_link][0], atol=1e-6)


def test_limits_are_shown_as_it_moves(page: Page) -> None:
    texts = []
    for time in (0.5, 2.5):
        page.value(f"exciteReport.players[0].seek({time})")
        texts.append(page.value("document.querySelector('.meters').innerText"))
        assert page.value("document.querySelector('.nearest').textContent").startswith("Nearest limit: ")
    assert texts[0] != texts[1]
    assert "BROKEN" not in texts[0] + texts[1]
    widths = page.value("[...document.querySelectorAll('.fill')].map((e) => parseFloat(e.style.width))")
    assert 0 < max(widths) <= 100


def test_the_view_is_drawn_before_the_page_counts_as_loaded(page: Page, path: Path) -> None:
    page.open(path)
    colours = """(() => {
        const from = document.querySelector('.stage canvas');
        const to = Object.assign(document.createElement('canvas'), { width: 64, height: 64 }).getContext('2d');
        to.drawImage(from, 0, 0, 64, 64);
        return new Set(new Uint32Array(to.getImageData(0, 0, 64, 64).data.buffer)).size;
    })()"""
    assert page.value(colours) > 20


def test_measured_motion_plays_with_its_torques(page: Page) -> None:
    page.value("exciteReport.players[1].seek(0.5)")
    heads = page.value("[...document.querySelectorAll('.meters')[1].tHead.rows[0].cells].map((e) => e.textContent)")
    assert heads[1:] == ["position", "velocity", "measured", "predicted", "distance"]
    before = page.value("exciteReport.players[1].pose()")
    page.value("exciteReport.players[1].seek(1.1)")
    assert page.value("exciteReport.players[1].pose()") != before
    measured = result("old").prepared[0].samples.q[0]
    assert page.value("exciteReport.players[1].data.q[0]")[:3] == pytest.approx(measured.tolist(), abs=1e-6)


def test_figures_are_dark_on_dark_screens_and_white_on_paper(page: Page) -> None:
    shown = "[...new Set([...document.querySelectorAll('.paper svg')].map((svg) => getComputedStyle(svg).filter))]"
    page.call("Emulation.setEmulatedMedia", features=DARK)
    assert page.value(shown) == ["invert(0.9) hue-rotate(180deg)"]
    page.call("Emulation.setEmulatedMedia", media="print", features=DARK)
    assert page.value(shown) == ["none"]
    page.call("Emulation.setEmulatedMedia", media="", features=[])


def test_tables_sort_by_keys_and_clicks(page: Page) -> None:
    values = "[...document.querySelectorAll('[data-table=parameters] tbody tr')].map((r) => +r.cells[1].dataset.value)"
    page.value("document.querySelectorAll('[data-table=parameters] thead th button')[1].focus()")
    enter = {"key": "Enter", "code": "Enter", "windowsVirtualKeyCode": 13}
    page.call("Input.dispatchKeyEvent", type="keyDown", text="\r", **enter)
    page.call("Input.dispatchKeyEvent", type="keyUp", **enter)
    assert page.value(values) == sorted(result("old").estimate.values.tolist())
    numbers = "[...document.querySelectorAll('[data-table=predicted] tbody tr')].map((r) => +r.cells[1].dataset.value)"
    heading = "document.querySelectorAll('[data-table=predicted] thead th')[1]"
    given = page.value(numbers)
    assert given == [each.standard_deviation for each in reported_design().predicted]
    for order, descending in (("ascending", False), ("descending", True)):
        page.value(f"{heading}.firstElementChild.click()")
        assert page.value(numbers) == sorted(given, reverse=descending)
        assert page.value(f"{heading}.getAttribute('aria-sort')") == order


def test_keys_and_buttons_play_it(page: Page) -> None:
    page.value("document.querySelector('.stage').focus()")
    page.press(".")
    assert page.value("exciteReport.players[0].time") == pytest.approx(0.05)
    page.press(" ")
    page.value("new Promise((done) => setTimeout(done, 700))")
    page.press(" ")
    time = page.value("exciteReport.players[0].time")
    assert time > 0.05
    assert page.value("document.querySelector('.play').textContent") == "Play"
    assert page.value("document.querySelector('.clock').textContent").startswith(f"{time:.2f} of")
    before = page.value("exciteReport.players[0].view.orbit.camera.position.toArray()")
    for key in ("ArrowLeft", "+"):
        page.press(key)
    assert page.value("exciteReport.players[0].view.orbit.camera.position.toArray()") != before
    page.value("document.querySelector('.play').click()")
    assert page.value("document.querySelector('.play').textContent") == "Pause"


@pytest.mark.parametrize("width", [320, 390, 1280])
def test_page_is_as_wide_as_the_screen(width: int, page: Page) -> None:
    page.call("Emulation.setDeviceMetricsOverride", width=width, height=800, deviceScaleFactor=1, mobile=width < 600)
    assert page.value("document.documentElement.scrollWidth") <= width
    wide = "(e) => e.clientWidth && e.scrollWidth > e.clientWidth + 1"
    shown = f"[...document.querySelectorAll('main :not(svg *)')].filter({wide}).map((e) => e.outerHTML.slice(0, 80))"
    assert page.value(shown) == []


def test_a_seven_axis_page_with_meshes_is_small(browser: Page, tmp_path: Path) -> None:
    arm = next(arm for arm in ARMS if arm.id == "panda-hand")
    motion = {"harmonics": 2, "period": 5.0, "starts": 1, "executor": "serial", "acceleration": (10.0,)}
    design = excite.design_trajectory(excite.Task(str(arm.path), base_link=arm.base, tip=arm.tip, **motion))
    path = excite.write_report(design, tmp_path / "page.html", robot_file=arm.path)
    assert path.stat().st_size < MOST_BYTES
    browser.errors.clear()
    browser.open(path)
    assert browser.errors == []
    motion = json.loads(browser.value("document.querySelector('script[type]').textContent"))
    assert len({mesh["body"] for mesh in motion["meshes"]}) >= 7
