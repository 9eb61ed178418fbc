"""Attacks on the skill layer from outside: through the clients' public interface, over rclpy, rospy and in virtual time alike."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from alula_testing.attacks import ATTACKS, LocalGraph
from alula_testing.attacks.rampage import WRONG, rampage

ALULA_ROOT = Path(__file__).resolve().parents[1]
END_S = 60.0
Attack = Callable[[str], dict[str, Any]]


class Attacker:
    """A process that attacks managers of its own over one middleware; started when it is first needed."""

    def __init__(self, world: str) -> None:
        self._world = world
        self._process: subprocess.Popen[str] | None = None

    def __call__(self, name: str) -> dict[str, Any]:
        """Run an attack and return what it has found."""
        process = self._process = self._process or self._start()
        process.stdin.write(f"{name}\n")
        process.stdin.flush()
        found = json.loads(process.stdout.readline())
        assert "error" not in found, found["error"]
        return found

    def _start(self) -> subprocess.Popen[str]:
        environment = {k: v for k, v in os.environ.items() if not k.startswith(("ROS_", "PYTHON", "AMENT", "CMAKE", "LD_"))}
        command = [str(ALULA_ROOT / "setup" / f"in_{self._world}"), "python", "-m", "alula_testing.attacks", self._world]
        return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment)

    def end(self) -> None:
        """End the process."""
        if self._process is None:
            return
        self._process.stdin.close()
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._process.stdout.close()


@pytest.fixture(scope="module")
def attackers() -> Iterator[dict[str, Attack]]:
    live = {world: Attacker(world) for world in ("ros1", "ros2")}
    yield {**live, "local": lambda name: ATTACKS[name](LocalGraph())}
    for attacker in live.values():
        attacker.end()


@pytest.fixture
def attack(attackers: dict[str, Attack], world: str) -> Attack:
    return attackers[world]


def worlds(*names: str, **known: str) -> pytest.MarkDecorator:
    """Run a test in these worlds; ``known`` are those where it fails, with the reason."""
    failing = [pytest.param(world, marks=pytest.mark.xfail(strict=True, reason=reason)) for world, reason in known.items()]
    return pytest.mark.parametrize("world", [*names, *failing])


@worlds("ros1", "ros2", "local")
def test_each_of_100_transitions_at_once_is_answered(attack):
    assert attack("hundred_transitions") == {"unanswered": []}


@worlds("ros1", "ros2", "local")
def test_each_of_300_goals_at_once_is_served(attack):
    assert attack("three_hundred_goals") == {"outcomes": {"RUNNING": 1, "NOT_READY": 299}, "messages": []}


@worlds("ros1", "ros2", "local")
def test_each_of_20_pauses_at_once_is_answered(attack):
    assert attack("twenty_pauses") == {"unanswered": [], "refused": []}


@worlds("ros1", "ros2")
def test_a_script_may_end_without_closing_its_client(attack):
    found = attack("unclosed")
    assert (found["outcome"], found["code"]) == ("INTERRUPTED", 0), found
    assert "terminate called" not in found["said"]
    assert "Traceback" not in found["said"]


@worlds("ros1", "ros2")
def test_what_a_client_has_given_up_does_not_run_on_when_frozen_managers_come_back(attack):
    assert attack("freeze") == {"before": "FAILED", "meanwhile": "FAILED", "afterwards": ""}


@worlds("ros1", "ros2")
def test_second_managers_of_a_skillset_refuse_to_start(attack):
    found = attack("second_managers")
    assert found["code"] == 2, found
    assert "navigation" in found["said"], found
    assert found["unanswered"] == []


@pytest.mark.parametrize("seed", range(3))
def test_whatever_clients_and_hooks_do_each_execution_ends_once_and_nothing_runs_on(seed):
    found = rampage("local", 600, kills=2, seed=seed)
    assert {what: found[what] for what in WRONG if found.get(what)} == {}
    assert len(found["outcomes"]) >= 5, found
