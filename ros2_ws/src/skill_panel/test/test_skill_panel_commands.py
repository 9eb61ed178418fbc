"""The commands that drive skillsets from a shell, over mocks in virtual time."""

from __future__ import annotations

import json
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import navigation_managers.model as navigation
import perception_managers.model as perception
import pytest

from alula.common.network import claim_domain
from alula.common.record import EVENTS, FILE, RecordWriter
from alula.generate.scaffold.skeleton import files_of
from alula.mock import load_behaviour, mock_world
from skill_panel import commands
from skill_panel.__main__ import Place, place_of
from skill_panel.commands import COMMANDS, CommandError, main, parse


class Shell:
    """Does commands as `./alula` does, on clients that are there already."""

    def __init__(self) -> None:
        self.world, _ = mock_world([navigation.SKILLSET], load_behaviour([], [navigation.SKILLSET]))
        self.clients = {"navigation": self.world.client("navigation")}
        assert self.clients["navigation"].wait_ready(5.0)
        self.said: list[tuple[Any, str]] = []

    def __call__(self, *words: str) -> int:
        options = parse(words)
        self.said.clear()
        return COMMANDS[options.command](self.clients, options, lambda value, text: self.said.append((value, text)))

    @property
    def value(self) -> Any:
        (said,) = self.said
        json.dumps(said[0])
        return said[0]


@pytest.fixture
def shell() -> Shell:
    return Shell()


def test_a_skill_is_asked_for_and_refused_until_it_can_start(shell: Shell) -> None:
    assert shell("why", "takeoff") == 1
    assert "SDK_authority" in json.dumps(shell.value)
    assert shell("start", "takeoff", "height=3", "speed=1") == 1
    assert (shell.value["outcome"], shell.value["result"]) == ("NOT_READY", "sdk_authority")
    assert shell("transition", "navigation.SDK_authority", "AVAILABLE") == 0
    assert shell("transition", "navigation.homepoint_status", "VALID") == 0
    assert shell("why", "navigation.takeoff") == 0
    assert shell("start", "takeoff", "height=3", "speed=1") == 0
    assert shell.value["outcome"] == "TERMINATED"


def test_what_is_refused_or_not_there_is_exit_code_1(shell: Shell) -> None:
    assert shell("transition", "navigation.axes_authority", "USED") == 1
    assert shell.value["accepted"] is False
    assert shell("interrupt", "goto") == 1
    assert shell.value == {"skill": "goto", "interrupted": 0}


def test_the_list_has_inputs_resources_and_data(shell: Shell) -> None:
    assert shell("skills") == 0
    assert set(shell.value["skills"]["takeoff"]["inputs"]) == {"height", "speed"}
    assert shell.value["resources"]["flight_status"] == "ON_GROUND"
    assert "  flight_status = ON_GROUND" in shell.said[0][1].splitlines()


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("start", "takeof"), "there is no skill takeof; did you mean `takeoff`"),
        (("start", "takeoff", "heigth=3"), "takeoff has no input heigth; did you mean `height`"),
        (("start", "takeoff", "3"), "3: write an input as key=value"),
        (("start", "takeoff", "height=[1"), "height: '[1' can't be read"),
        (("transition", "flight_status", "IN_AIR"), "there is no resource flight_status; write SKILLSET.NAME"),
    ],
)
def test_wrong_words_are_named_with_what_is_meant(shell: Shell, words: tuple[str, ...], complaint: str) -> None:
    with pytest.raises(CommandError) as error:
        shell(*words)
    assert complaint in str(error.value)


class LateGraph:
    """A graph that tells of one skillset after another; ``Robot`` and ``Session`` that know no middleware."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **appear_s: float) -> None:
        self.world, _ = mock_world([navigation.SKILLSET, perception.SKILLSET], load_behaviour([], [navigation.SKILLSET]))
        self._appear_s = appear_s
        self._began_s = time.monotonic()
        monkeypatch.setattr(commands, "skillsets_in", self._look)
        monkeypatch.setattr("skillset_ros2.robot.Robot", self._robot)
        monkeypatch.setattr("skillset_ros2.session.Session", lambda *_, **__: SimpleNamespace(node=None, close=lambda: None))

    def _look(self, _: object, namespace: str) -> list[tuple[str, str]]:
        passed_s = time.monotonic() - self._began_s
        found = [f"/{name}".rpartition("/") for name, appears_s in self._appear_s.items() if appears_s <= passed_s]
        return [(space.rstrip("/"), name) for space, _, name in found if space.startswith(namespace)]

    def _robot(self, _: object, names: list[str], **__: object) -> Any:
        clients = {name: self.world.client(name) for name in names}
        wait_ready = lambda timeout_s: all(client.wait_ready(timeout_s) for client in clients.values())  # noqa: E731
        return SimpleNamespace(clients=clients, wait_ready=wait_ready, close=lambda: None)


def test_all_skillsets_are_listed_however_late_the_graph_tells_of_them(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    LateGraph(monkeypatch, navigation=0.1, perception=0.6)
    assert main(["skills", "--domain", "5", "--json"]) == 0
    assert [json.loads(line)["skillset"] for line in capsys.readouterr().out.splitlines()] == ["navigation", "perception"]


def test_a_participant_whose_first_announcement_was_lost_is_waited_for(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """DDS announces it again after three seconds."""
    LateGraph(monkeypatch, navigation=3.5)
    assert main(["skills", "--domain", "5", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["skillset"] == "navigation"


@pytest.fixture
def deployed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A robot with a deployment, lab, and the folder in which its being up would be said."""
    for path, text in files_of("rover").items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text, encoding="utf-8")
    (tmp_path / "deployments/robot.yaml").rename(tmp_path / "deployments/lab.yaml")
    monkeypatch.setenv("ALULA_ROBOT", str(tmp_path))
    monkeypatch.setenv("ALULA_ROBOT_STATE", str(tmp_path / ".alula"))
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    return tmp_path / ".alula/up/lab"


def test_a_deployment_that_is_up_is_talked_to(deployed: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["skills", "--on", "lab"]) == 2
    assert main(["skills", "--on", "lob"]) == 2
    assert capsys.readouterr().err.splitlines() == [
        "alula skills: lab is not up on this computer: alula up lab",
        f"alula skills: there is no deployment 'lob' in {deployed.parents[2] / 'deployments'}; did you mean `lab`?",
    ]
    claim = claim_domain()
    deployed.mkdir(parents=True)
    (deployed / "run.json").write_text(json.dumps({"deployment": "lab", "domain": claim.domain, "namespace": "/rover"}), encoding="utf-8")
    place = Place(claim.domain, f"on lab (DDS domain {claim.domain}, /rover)", "/rover")
    try:
        assert place_of(parse(["skills", "--on", "lab"])) == place_of(parse(["skills"])) == place
    finally:
        claim.release()
    assert place_of(parse(["skills"])).domain == 0, "it is down by now"


def test_a_skill_of_a_skillset_that_the_graph_tells_of_late_is_found(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    LateGraph(monkeypatch, perception=0.1, navigation=2.0)
    assert main(["why", "takeoff", "--domain", "5"]) == 1
    assert "SDK_authority" in capsys.readouterr().out


def test_of_several_robots_one_has_to_be_named(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    LateGraph(monkeypatch, **{"drone/navigation": 0.1, "other/navigation": 0.1})
    assert main(["why", "takeoff", "--domain", "5"]) == 2
    said = "alula why: 2 robots run in DDS domain 5: say which by --namespace: /drone, /other\n"
    assert capsys.readouterr().err == said
    assert main(["why", "takeoff", "--domain", "5", "--namespace", "/drone"]) == 1
    assert "SDK_authority" in capsys.readouterr().out


def test_events_of_a_run_are_read_from_its_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "run.json").write_text('{"domain": 5}')
    record = {"stamp_s": 3.5, "sequence": 1, "skillset": "navigation", "kind": "TRANSITION"}
    record |= {"resource": "flight_status", "from_state": "ON_GROUND", "to_state": "IN_AIR", "cause": "extern"}
    writer = RecordWriter(tmp_path / FILE)
    writer.write(EVENTS, 3_500_000_000, record)
    writer.close()
    assert main(["events", "--run", str(tmp_path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == record
    assert main(["events", "--run", str(tmp_path)]) == 0
    assert capsys.readouterr().out == "    3.50 s  navigation.flight_status: ON_GROUND -> IN_AIR (extern)\n"
    assert main(["events", "--run", str(tmp_path / "none")]) == 2
    assert "is no run's folder" in capsys.readouterr().err
