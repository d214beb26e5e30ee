"""The summary of every command on simulated data: the verdict first, on one screen; quiet; as one JSON document."""

from __future__ import annotations

import json

import pytest
from commands import COMMANDS, Here

from excite.cli.summary import show
from excite.views.view import View

LINES, COLUMNS = 30, 100
QUICK = "--starts 1 --harmonics 3 --period 4 --executor serial"
LOGS = "--rate 200 --torque-noise 0.3"
HELD = "--payload 2,0,0,0.1,0.01,0,0,0.01,0,0.01"
# what each command is run with, in an order in which the one before writes what the next one reads
SESSION = {
    "design": f"design ROBOT {QUICK} --out d",
    "with a load": f"design ROBOT {QUICK} {HELD} --out dh",
    "simulate": f"simulate d {LOGS} --out run.csv",
    "another log": f"simulate d {LOGS} --seed 1 --out other.csv",
    "a third log": f"simulate d {LOGS} --seed 2 --out third.csv",
    "with the load": f"simulate dh --trajectory d/trajectory.csv {LOGS} --out held.csv",
    "identify": "identify ROBOT run.csv --design d --out r",
    "verify": "verify r other.csv",
    "verify several": "verify r other.csv third.csv --out v",
    "compare": "compare d dh",
    "bound": "bound d",
    "predict": "predict d --torque-noise 0.3 --rate 200 --count 10",
    "sweep run": "sweep run irp6.yaml --executor serial --out c",
    "plan": "plan ROBOT",
    "plan towards a precision": "plan ROBOT --precision 1000% --after r,d",
    "export": "export d --format npz --out play.npz",
    "export of a model": "export r --format urdf --out model.urdf",
    "logs": "logs run.csv --robot ROBOT",
    "study": "study ROBOT run.csv --design d --repeats 2 --points 5 --rate 200 --out s",
    "friction plan": "friction plan ROBOT --drives 2 --speeds 20,40,60,80 --warm-up 0 --breakaways 0 --out p",
    "the runs": "simulate p/z2.csv --controller pd --bandwidth 10 --rate 500 --out f.csv",
    "friction fit": "friction fit ROBOT f.csv --plan p --out f",
    "payload design": "payload design ROBOT --starts 1 --out m",
    "payload gains": "payload gains ROBOT --without run.csv --with held.csv --mass 2 --out gains.yaml",
    "payload identify": "payload identify ROBOT --without run.csv --with held.csv --out held",
    "report": "report r --out page.html",
    "robots": "robots ROBOT",
}
CAMPAIGN = "{common: {robot: irp6, starts: 1, harmonics: 3}, grid: {trajectory: [fourier, cosine]}}"
FORCED = ("design", "simulate", "identify", "export", "study", "friction", "payload", "report")


def words_of(line: str, *, again: bool) -> list[str]:
    """The words of a command of the session."""
    words = line.replace("ROBOT", "irp6").split()
    return [*words, "--force"] if again and words[0] in FORCED else words


def test_the_session_has_every_command() -> None:
    run = {" ".join(line.split()[: 1 + line.startswith(("friction", "payload", "sweep"))]) for line in SESSION.values()}
    assert run == set(COMMANDS)


def faults(ended, name: str) -> list[str]:  # type: ignore[no-untyped-def]
    """What is wrong with a summary in text."""
    lines = ended.stdout.splitlines()
    found = [] if ended.returncode in (0, 1) else [f"{name}: status {ended.returncode}: {ended.stderr}"]
    if name == "robots" or found:  # a description, of any length
        return found
    if not 1 <= len(lines) <= LINES:
        found.append(f"{name}: {len(lines)} lines")
    found += [f"{name}: {len(line)} columns: {line}" for line in lines if len(line) > COLUMNS]
    if lines[:1] and lines[0].startswith(("note", "written", "next", " ")):
        found.append(f"{name}: no verdict first: {lines[0]}")
    return found


def test_figures_are_drawn_when_the_numbers_are_on_the_screen(capsys: pytest.CaptureFixture[str]) -> None:
    seen: list[str] = []
    show(View("d", "it holds", summary=("a number",)), lambda: seen.append(capsys.readouterr().out) or [], content=dict)
    assert seen == ["it holds\na number\n"]


@pytest.mark.slow
def test_summaries_fit_a_screen_and_are_quiet_or_json_if_asked(here: Here) -> None:
    """Every command twice: as text, and every second one with ``--quiet``, the others with ``--json``."""
    found: list[str] = []
    (here.cwd / "irp6.yaml").write_text(CAMPAIGN)
    for number, (name, line) in enumerate(SESSION.items()):
        text = here.run(*words_of(line, again=False))
        found += faults(text, name)
        way = ("--json", "-q")[number % 2]
        ended = here.run(*words_of(line, again=True), way)
        (here.cwd / "held.json").unlink(missing_ok=True)  # says that the load is a part of the robot
        assert ended.returncode == text.returncode, f"{name}: {ended.stderr}"
        if way == "-q":
            assert (ended.stdout.count("\n"), ended.stderr) == (1, ""), name
            verdicts = [ended.stdout]
        else:
            content = json.loads(ended.stdout)
            verdicts = [one["verdict"] for one in (content if isinstance(content, list) else [content])]
        assert all(isinstance(verdict, str) and verdict for verdict in verdicts), name
        if len(verdicts) == 1 and name != "robots":
            assert verdicts[0].split()[:2] == text.stdout.split()[:2], name
    assert found == []
