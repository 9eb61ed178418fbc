"""The same stimuli over rclpy, rospy and no middleware at all: the same executions, transitions, causes, results and messages."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from alula.language.counterexamples import Counterexample
from alula_testing.counterexamples import MODELS, counterexamples
from alula_testing.live_counterexample import from_line, to_line
from alula_testing.misbehaviours import MISBEHAVIOURS
from alula_testing.traces import Behaviour, Script, Step, play
from alula_testing.traces.stage_none import NoneStage

ALULA_ROOT = Path(__file__).resolve().parents[1]
ANSWER_S = 120.0


class Player:
    """A process that plays scripts over one middleware."""

    def __init__(self, world: str) -> None:
        self._asked = 0
        environment = {k: v for k, v in os.environ.items() if not k.startswith(("ROS_", "PYTHON", "AMENT", "CMAKE", "LD_"))}
        self._process = subprocess.Popen(
            [str(ALULA_ROOT / "setup" / f"in_{world}"), "python", "-m", "alula_testing.traces", world],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
        )

    def ask(self, script: Script) -> None:
        self._asked += 1
        self._process.stdin.write(json.dumps(script.to_plain()) + "\n")
        self._process.stdin.flush()

    def answer(self) -> dict[str, Any]:
        # After a script that failed elsewhere, an answer may be left unread.
        while self._asked:
            self._asked -= 1
            trace = json.loads(self._process.stdout.readline())
        assert "error" not in trace, trace["error"]
        return trace

    def end(self) -> None:
        self._process.stdin.close()
        try:
            self._process.wait(ANSWER_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._process.stdout.close()


@pytest.fixture(scope="module")
def players() -> Iterator[dict[str, Player]]:
    started = {world: Player(world) for world in ("ros1", "ros2")}
    yield started
    for player in started.values():
        player.end()


def traces_of(players: dict[str, Player], script: Script) -> dict[str, dict[str, Any]]:
    """Play a script over all middlewares at the same time."""
    for player in players.values():
        player.ask(script)
    return {"none": play(script, NoneStage)} | {world: player.answer() for world, player in players.items()}


def compare(players: dict[str, Player], script: Script) -> dict[str, Any]:
    """Return the trace that all middlewares agree on."""
    traces = traces_of(players, script)
    for world in players:
        assert traces[world] == traces["none"], world
    return traces["none"]


PUBLIC_API = """
import inspect, json, sys
from {module} import {client} as client
names = [name for name in dir(client) if not name.startswith("_")]
found = {{name: str(inspect.signature(m)) if callable(m := inspect.getattr_static(client, name)) else "property" for name in names}}
json.dump(found, sys.stdout)
"""
CLIENTS = {
    "ros1": ("skillset_ros1", "SkillsetClient"),
    "ros2": ("skillset_ros2", "SkillsetClient"),
    "none": ("alula.runtime.local", "LocalClient"),
}


def test_clients_have_the_same_public_interface_in_all_worlds():
    found = {}
    for world, (module, client) in CLIENTS.items():
        command = [str(ALULA_ROOT / "setup" / f"in_{'ros1' if world == 'ros1' else 'ros2'}"), "python", "-c"]
        program = PUBLIC_API.format(module=module, client=client)
        done = subprocess.run([*command, program], capture_output=True, text=True, check=False, timeout=ANSWER_S)
        assert done.returncode == 0, done.stderr
        found[world] = json.loads(done.stdout)
    assert found["ros1"] == found["ros2"] == found["none"]
    assert {"start", "trigger", "read_data", "input_types", "interrupt_all", "on_event"} <= set(found["none"])


PLAYERS = {"ros1": "alula_testing.counterexample_world_ros1", "ros2": "alula_testing.counterexample_world_ros2"}
PLAYS_S = 600.0


def lines_of_counterexamples(folder: Path) -> Iterator[tuple[str, Counterexample, str]]:
    """Yield the counterexample of each finding of the models, as a player reads it; and one that is not so."""
    for name, text in MODELS.items():
        skillset, findings = counterexamples(folder / "model.rl", text)
        for finding in findings:
            yield f"{name} {finding.code}", finding.counterexample, to_line(skillset, finding.counterexample)
    *steps, last = finding.counterexample.steps
    wrong = replace(last, states=tuple((resource, "Nowhere") for resource, _ in last.states))
    yield "wrong", (counterexample := Counterexample((*steps, wrong))), to_line(skillset, counterexample)


@pytest.mark.parametrize("world", PLAYERS)
def test_each_counterexample_of_the_proofs_comes_to_its_end_in_managers_over_a_ros(world, tmp_path):
    played = list(lines_of_counterexamples(tmp_path))
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("ROS_", "PYTHON", "AMENT", "CMAKE", "LD_"))}
    command = [str(ALULA_ROOT / "setup" / f"in_{world}"), "python", "-m", PLAYERS[world]]
    lines = "".join(line for _, _, line in played)
    done = subprocess.run(command, input=lines, stdout=subprocess.PIPE, text=True, env=environment, timeout=PLAYS_S, check=True)
    answers = done.stdout.splitlines()
    assert len(answers) == len(played) > 20
    *found, (_, wrong) = [(name, from_line(counterexample, line)) for (name, counterexample, _), line in zip(played, answers, strict=True)]
    assert {name: steps[-1].differences for name, steps in found if any(step.differences for step in steps)} == {}
    assert [len(steps) for _, steps in found] == [len(counterexample.steps) for _, counterexample, _ in played[:-1]]
    assert "Nowhere in the counterexample" in wrong[-1].differences[0]


TAKEOFF = {"height": 3, "speed": 1}
STRAIGHT = {"target": [1, 2.5, 3], "speed": 1}
EXECUTION_FIELDS = 10
"""Of an event of an execution in a trace; those of transitions have less."""
READY = (
    Step("transition", resource="SDK_authority", state="AVAILABLE"),
    Step("transition", resource="homepoint_status", state="VALID"),
)
FLYING = (*READY, Step("transition", resource="link", state="UP"), Step("transition", resource="flight_status", state="IN_AIR"))


def states(trace: dict[str, Any], label: str) -> list[str]:
    return [event[3] for event in trace["events"] if len(event) == EXECUTION_FIELDS and event[2] == label]


def ends_told(trace: dict[str, Any]) -> dict[str, tuple[str, list[dict[str, Any]]]]:
    """Return of each execution that has ended the kind of its result and what was unmet, as its last event tells."""
    return {event[2]: tuple(event[8:]) for event in trace["events"] if len(event) == EXECUTION_FIELDS}


def test_refusals_with_their_reasons_to_the_caller(players):
    script = Script(
        (
            Step("start", "early", "takeoff", TAKEOFF),
            *READY,
            Step("start", "high", "takeoff", {"height": 300, "speed": 1}),
            Step("start", "first", "takeoff", TAKEOFF),
            Step("start", "second", "takeoff", TAKEOFF, client=1),
            Step("start", "other", "goto_straight", STRAIGHT, client=1),
            Step("late"),
            Step("finish", "first", result="AT_ALTITUDE"),
            Step("transition", resource="axes_authority", state="USED"),
            Step("transition", resource="wings", state="USED"),
        ),
        {"takeoff": (Behaviour(), Behaviour(refuse="too high"))},
    )
    trace = compare(players, script)
    assert {label: end[:2] for label, end in trace["ends"].items()} == {
        "early": ["NOT_READY", "sdk_authority"],
        "high": ["NOT_VALIDATED", ""],
        "first": ["TERMINATED", "AT_ALTITUDE"],
        "second": ["NOT_READY", "not_moving"],
        "other": ["NOT_READY", "not_moving"],
    }
    assert trace["ends"]["high"][2] == "too high"
    refused = {label: (kind, [(one["name"], one["states"]) for one in unmet]) for label, (kind, unmet) in ends_told(trace).items()}
    assert refused == {
        "early": ("", [("sdk_authority", {"SDK_authority": "UNAVAILABLE"})]),
        "high": ("", []),
        "first": ("success", []),
        "second": ("", [("not_moving", {"axes_authority": "USED"})]),
        "other": ("", [("not_moving", {"axes_authority": "USED"})]),
    }
    assert trace["hooks"] == {"early": [], "high": [], "first": ["on_dispatch"], "second": [], "other": []}
    resources, last = trace["replies"][2]
    assert resources["axes_authority"] == "USED"
    assert last == {
        "takeoff": ["second", "NOT_READY", "not_moving", trace["ends"]["second"][2]],
        "goto_straight": ["other", "NOT_READY", "not_moving", trace["ends"]["other"][2]],
    }
    accepted = [reply[0] for reply in trace["replies"] if len(reply) == 3]
    assert accepted == [True, True, False, False]


def test_a_script_that_ends_as_every_play_does_is_heard_to_its_end(players):
    last = Step("transition", resource="homepoint_status", state="INVALID")
    trace = compare(players, Script((*READY, Step("start", "on ground", "land"), last)))
    assert [event[1:4] for event in trace["events"][-2:]] == [
        ["homepoint_status", "VALID", "INVALID"],
        ["homepoint_status", "INVALID", "VALID"],
    ]


def test_ends_of_every_kind(players):
    script = Script(
        (
            *FLYING,
            Step("start", "arrives", "goto_straight", STRAIGHT),
            Step("start", "stopped", "goto_straight", STRAIGHT),
            Step("interrupt", "stopped"),
            Step("start", "violated", "goto_straight", STRAIGHT),
            Step("transition", resource="SDK_authority", state="UNAVAILABLE"),
            Step("transition", resource="SDK_authority", state="AVAILABLE"),
            Step("start", "wrong", "hover", {"duration": 1}),
            Step("finish", "wrong", result="NONSENSE"),
            Step("interrupt", "arrives"),
            Step("start", "blocked", "goto", STRAIGHT),
            Step("finish", "blocked", result="BLOCKED"),
        ),
        {"goto_straight": (Behaviour(ends="ARRIVED", message="there"),)},
    )
    trace = compare(players, script)
    assert {label: end[0] for label, end in trace["ends"].items()} == {
        "arrives": "TERMINATED",
        "stopped": "INTERRUPTED",
        "violated": "RESOURCE_INVARIANT_VIOLATED",
        "wrong": "FAILED",
        "blocked": "TERMINATED",
    }
    told = ends_told(trace)
    kinds = {label: kind for label, (kind, _) in told.items()}
    assert kinds == {"arrives": "success", "stopped": "", "violated": "", "wrong": "", "blocked": "failure"}
    unmet = {
        "name": "keep_sdk_authority",
        "condition": "SDK_authority == AVAILABLE",
        "states": {"SDK_authority": "UNAVAILABLE"},
        "data": {},
    }
    assert told["violated"][1] == [unmet | {"reason": "keep_sdk_authority: SDK_authority is UNAVAILABLE"}]
    assert trace["ends"]["violated"][2].startswith(told["violated"][1][0]["reason"])
    assert states(trace, "arrives") == ["REQUESTED", "RUNNING", "TERMINATED"]
    assert trace["ends"]["arrives"][1:3] == ["ARRIVED", "there"]
    assert trace["hooks"]["violated"] == ["on_dispatch", "on_violation"]
    assert [event[4] for event in trace["events"] if event[1] == "axes_authority"][:2] == [
        "goto_straight arrives take_control",
        "goto_straight arrives release_control",
    ]


def test_pauses_and_questions(players):
    script = Script(
        (
            Step("why", skill="hover"),
            *FLYING,
            Step("why", skill="hover", inputs={"duration": 1.0}),
            Step("start", "rests", "hover", {"duration": 1}),
            Step("pause", "rests"),
            Step("pause", "rests"),
            Step("why", skill="goto"),
            Step("resume", "rests"),
            Step("pause", "rests"),
            Step("transition", resource="SDK_authority", state="UNAVAILABLE"),
            Step("pause", "rests"),
            Step("transition", resource="SDK_authority", state="AVAILABLE"),
            Step("start", "restless", "hover", {"duration": 1}),
            Step("pause", "restless"),
        ),
        {"hover": (Behaviour(), Behaviour(pauses=True))},
    )
    trace = compare(players, script)
    assert trace["hooks"]["rests"] == ["on_dispatch", "on_pause", "on_resume", "on_pause", "on_violation"]
    assert trace["hooks"]["restless"][:2] == ["on_dispatch", "on_pause"]
    assert states(trace, "rests") == ["REQUESTED", "RUNNING", "PAUSED", "RUNNING", "PAUSED", "RESOURCE_INVARIANT_VIOLATED"]
    answers = [reply for reply in trace["replies"] if isinstance(reply[-1], list)]
    assert [reply[0] for reply in answers] == [False, True, False]
    assert answers[2][2][-1] == "hover rests take_control"
    assert [reply[0] for reply in trace["replies"] if len(reply) == 2] == [True, True, True, True, False, False]


@pytest.mark.parametrize("hook", ["validate", "on_dispatch", "on_interrupt", "on_violation"])
def test_hooks_that_raise(players, hook):
    script = Script(
        (
            *FLYING,
            Step("start", "one", "hover", {"duration": 1}),
            Step("transition", resource="SDK_authority", state="UNAVAILABLE") if hook == "on_violation" else Step("interrupt", "one"),
            Step("transition", resource="SDK_authority", state="AVAILABLE"),
            Step("start", "two", "hover", {"duration": 1}),
        ),
        {"hover": (Behaviour(raises=hook),)},
    )
    trace = compare(players, script)
    if hook == "on_violation":
        assert trace["ends"]["one"][0] == "RESOURCE_INVARIANT_VIOLATED"
    else:
        assert trace["ends"]["one"][::2] == ["FAILED", f"{hook} raised RuntimeError: {hook} was told to"]
    assert states(trace, "two") == ["REQUESTED", "RUNNING"]


def provoked(name: str, hook: str) -> list[Step]:
    """Return a start, and what has the hook of its execution called; each leaves the vehicle as it was."""
    start = Step("start", name, "hover", {"duration": 1})
    lost, back = (Step("transition", resource="SDK_authority", state=state) for state in ("UNAVAILABLE", "AVAILABLE"))
    following = {
        "on_interrupt": [Step("interrupt", name)],
        "on_pause": [Step("pause", name)],
        "on_resume": [Step("pause", name), Step("resume", name)],
        "on_violation": [lost, back],
        "on_failure": [Step("fail", name)],
    }
    return [start, *following.get(hook, [])]


def test_hooks_that_misbehave_end_their_own_execution_only(players):
    steps = [step for name, misbehaviour in MISBEHAVIOURS.items() for step in provoked(name, misbehaviour.hook)]
    behaviours = tuple(Behaviour(misbehaves=name, pauses=True) for name in MISBEHAVIOURS)
    trace = compare(players, Script((*FLYING, *steps, Step("start", "as ever", "hover", {"duration": 1})), {"hover": behaviours}))
    for name, misbehaviour in MISBEHAVIOURS.items():
        outcome, _, message, done = trace["ends"][name]
        assert (name, outcome, done) == (name, misbehaviour.outcome, True), message
        assert misbehaviour.says in message
        assert states(trace, name)[-1] == outcome
        assert len([state for state in states(trace, name) if state == outcome]) == 1
    assert states(trace, "as ever") == ["REQUESTED", "RUNNING"]


INPUTS = {
    "takeoff": TAKEOFF,
    "goto": STRAIGHT,
    "goto_straight": STRAIGHT,
    "rotate_head": {"heading": 1, "rate": 0.5},
    "lock_head": {"heading": 1},
    "hover": {"duration": 1},
    "land": {},
}
ENDS = ["AT_ALTITUDE", "ARRIVED", "ALIGNED", "DONE", "LANDED", "ABORTED"]
STATES = {
    "SDK_authority": ["AVAILABLE", "UNAVAILABLE"],
    "axes_authority": ["AVAILABLE", "USED"],
    "flight_status": ["ON_GROUND", "IN_AIR"],
    "homepoint_status": ["INVALID", "VALID"],
    "link": ["UNKNOWN", "UP", "DOWN"],
}
BEHAVIOURS = st.one_of(
    st.just(Behaviour()),
    st.builds(Behaviour, refuse=st.just("no")),
    st.just(Behaviour(pauses=True)),
    st.builds(Behaviour, ends=st.sampled_from(ENDS), message=st.text("ab ", max_size=3), after_s=st.just(0.01)),
    st.builds(Behaviour, raises=st.sampled_from(["validate", "on_dispatch", "on_interrupt", "on_violation", "on_failure"])),
)
TRANSITIONS = st.sampled_from([Step("transition", resource=r, state=s) for r, possible in STATES.items() for s in possible])


@st.composite
def scripts(draw) -> Script:
    """Any stimuli in any order, most of them in flight."""
    steps: list[Step] = list(draw(st.sampled_from([FLYING, READY, ()])))
    labels: list[str] = []
    for _ in range(draw(st.integers(3, 12))):
        kind = draw(st.sampled_from(["start", "start", "start", "transition", "interrupt", "finish", "pause", "resume", "why", "late"]))
        if kind == "start":
            labels.append(f"call{len(labels)}!")
            skill = draw(st.sampled_from(list(INPUTS)))
            steps.append(Step("start", labels[-1], skill, INPUTS[skill], client=draw(st.integers(0, 1))))
        elif kind == "transition":
            steps.append(draw(TRANSITIONS))
        elif kind in {"late", "why"}:
            steps.append(Step(kind, skill=draw(st.sampled_from(list(INPUTS)))))
        elif labels:
            steps.append(Step(kind, draw(st.sampled_from(labels)), result=draw(st.sampled_from(ENDS)) if kind == "finish" else ""))
    return Script(tuple(steps), {skill: tuple(draw(st.lists(BEHAVIOURS, max_size=3))) for skill in INPUTS})


@settings(max_examples=8, suppress_health_check=list(HealthCheck), database=None)
@given(script=scripts())
def test_any_script_has_the_same_trace_everywhere(players, script):
    trace = compare(players, script)
    numbers = [event[0] for event in trace["events"]]
    assert numbers == list(range(1, len(numbers) + 1))
    for label, (outcome, _, _, done) in trace["ends"].items():
        terminal = [state for state in states(trace, label) if state not in {"REQUESTED", "RUNNING", "PAUSED", "INTERRUPTING"}]
        assert terminal == ([outcome] if done else [])
