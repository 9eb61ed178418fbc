"""Resources that are known only as long as their reporter is heard of, over managers in virtual time."""

from __future__ import annotations

import pytest
from runtime_local_rig import Timed

from alula.common.faults import parse_fault
from alula.language.load import parse_skillset
from alula.mock import load_behaviour, mock_world
from alula.model.execution_state import ExecutionState
from alula.prove.skillset.prover import prove
from alula.records.conformance import Monitor
from alula.runtime.core.records import ResourceStatus
from alula.runtime.local import LocalWorld
from alula.runtime.local.middleware import VirtualMiddleware
from alula.runtime.middleware import REPORTED, ResourceStates

S = ExecutionState
WATCHED = parse_skillset("""skillset watched {
  resource estop {
    initial UNKNOWN
    silence = 2.0
    extern UNKNOWN -> RELEASED  extern UNKNOWN -> PRESSED  extern RELEASED -> PRESSED  extern PRESSED -> RELEASED
  }
  resource door { initial SHUT  extern SHUT -> OPEN  extern OPEN -> SHUT }
  skill drive {
    progress = 0.5
    precondition { safe: resource = (estop == RELEASED) }
    invariant { stays_safe: resource = (estop == RELEASED) }
    result { DONE }
  }
  skill stand {
    precondition { safe: resource = (estop == RELEASED) }
    invariant { not_pressed: resource = (estop == RELEASED or estop == UNKNOWN) }
    result { DONE }
  }
  property safe: never (drive running and estop == UNKNOWN)
  property known: never (stand running and estop == UNKNOWN)
}""")


class Watched:
    """Managers, a client, and a reporter that is heard of when the test says so."""

    def __init__(self) -> None:
        self.world = LocalWorld([WATCHED], lambda managers: {skill.name: Timed(managers, 200.0) for skill in WATCHED.skills})
        self.events: list = []
        self.world.on_event(lambda _, event: self.events.append(event))
        self.client = self.world.client("watched")
        assert self.client.wait_ready(1.0)
        self._reporter = VirtualMiddleware(self.world._bus, "watched").advertise(REPORTED)

    def report(self, resource: str, state: str) -> None:
        assert self.client.transition(resource, state).get(1.0).accepted

    def beat(self, *resources: str, times: int = 1) -> None:
        for _ in range(times):
            states = {name: ResourceStatus("RELEASED", "", 0) for name in resources}
            self._reporter.publish(ResourceStates("", 0, 0, states))
            self.world.run_for(0.5)


@pytest.fixture
def watched():
    return Watched()


def test_a_resource_whose_reporter_falls_silent_is_unknown_and_skills_know(watched):
    watched.report("estop", "RELEASED")
    watched.beat("estop", times=20)
    drive, stand = watched.client.start("drive"), watched.client.start("stand")
    watched.beat("estop", times=6)
    assert (drive.state, stand.state, watched.client.resources["estop"]) == (S.RUNNING, S.RUNNING, "RELEASED")
    watched.world.run_for(1.4)
    assert watched.client.resources["estop"] == "RELEASED"
    watched.world.run_for(0.2)
    assert watched.client.resources["estop"] == "UNKNOWN"
    assert watched.client.reasons["estop"] == "not heard of for 2 s"
    assert (drive.outcome, drive.result) == ("RESOURCE_INVARIANT_VIOLATED", "stays_safe")
    assert stand.state is S.RUNNING
    refused = watched.client.start("drive")
    watched.world.run_for(0.1)
    assert (refused.outcome, refused.result) == ("NOT_READY", "safe")
    monitor = Monitor([WATCHED])
    assert [finding for event in watched.events if (finding := monitor.take(event)) is not None] == []


def test_whoever_asks_hears_for_how_long_nothing_was_heard(watched):
    watched.report("estop", "RELEASED")
    watched.beat("estop")  # and half a second later
    told = []
    for _ in range(4):
        watched.world.run_for(1.0)
        told.append(watched.client.reasons["estop"])
    assert told == ["", "not heard of for 2 s", "not heard of for 3 s", "not heard of for 4 s"]
    said = "safe: estop is UNKNOWN, after estop RELEASED -> UNKNOWN (extern): not heard of for 4 s"
    assert watched.client.why("drive").get(1.0).reason == said
    refused = watched.client.start("drive")
    watched.world.run_for(0.1)
    assert (refused.outcome, refused.message) == ("NOT_READY", said)
    transitions = [event for event in watched.events if getattr(event, "resource", "") == "estop"]
    assert len(transitions) == 2, "that it lasts is no event"


def test_it_is_no_more_told_when_something_is_heard_again(watched):
    watched.report("estop", "RELEASED")
    watched.beat("estop")
    watched.world.run_for(3.0)
    watched.beat("estop")
    assert watched.client.resources["estop"] == "UNKNOWN", "it has not said anew what it is"
    assert watched.client.reasons["estop"] == ""
    assert watched.client.why("drive").get(1.0).reason == "safe: estop is UNKNOWN"
    watched.world.run_for(0.7)
    assert watched.client.reasons["estop"] == ""


def test_what_is_told_with_the_state_is_not_taken_away_by_a_heartbeat(watched):
    watched.report("estop", "RELEASED")
    watched.beat("estop")
    watched.world.run_for(3.0)
    watched.client.transition("estop", "UNKNOWN", "its cable is torn").get(1.0)
    watched.beat("estop")
    assert watched.client.reasons["estop"] == "its cable is torn"


def test_one_that_is_back_says_what_it_is_and_is_watched_again(watched):
    for _ in range(2):
        watched.report("estop", "RELEASED")
        watched.beat("estop")
        watched.world.run_for(1.0)
        assert watched.client.resources["estop"] == "RELEASED"
        watched.world.run_for(5.0)
        assert watched.client.resources["estop"] == "UNKNOWN"


def test_without_a_silence_or_a_heartbeat_what_was_said_is_believed(watched):
    watched.report("estop", "RELEASED")
    watched.report("door", "OPEN")
    watched.beat("door")
    watched.world.run_for(100.0)
    assert watched.client.resources == {"estop": "RELEASED", "door": "OPEN"}


def test_mocks_fall_silent_as_a_fault(tmp_path):
    (tmp_path / "mock.yaml").write_text("skills: {watched.drive: {delay: 50}}\ntimeline: [{after: 0, set: {watched.estop: RELEASED}}]")
    world, robot = mock_world([WATCHED], load_behaviour([tmp_path / "mock.yaml"], [WATCHED]))
    robot.fail(parse_fault("estop:silent@3-9"))
    client = world.client("watched")
    assert client.wait_ready(1.0)
    world.run_for(0.1)
    drive = client.start("drive")
    world.run_for(4.5)
    assert client.resources["estop"] == "RELEASED"
    world.run_for(1.0)
    assert (client.resources["estop"], client.reasons["estop"]) == ("UNKNOWN", "not heard of for 2 s")
    assert drive.result == "stays_safe"
    world.run_for(10.0)
    assert client.resources["estop"] == "RELEASED"


def test_proofs_take_the_silence_as_a_transition_of_the_world():
    (finding,) = prove(WATCHED)
    assert (finding.code, "property `known` (never) does not hold" in finding.message) == ("ALU531", True), finding
