"""A mission ends on the wall clock, with nothing that runs, also where the mission clock stands still."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("py_trees")

from alula.common.record import MISSION, OPERATOR, read_record
from alula.language.models import ModelFile, check_texts
from alula.missions.director import MissionResult, Outcome
from alula.missions.driver import MissionDriver
from alula.missions.mission_file import plan_of_file
from alula.missions.part import NO_PART
from alula.missions.record import MissionRecord
from alula.missions.running import STANDS, STANDS_S, run_to_the_end
from alula.missions.skillset import MissionClient
from alula.mock import load_behaviour, mock_world

MODEL = """
skillset rover { resource wheels { state { FREE USED } initial FREE transition { FREE -> USED USED -> FREE } }
  skill drive { success ARRIVED {} }
  skill look { success SEEN {} }
}
"""
MOCK = "skills: {rover.drive: {delay: 100}, rover.look: {delay: 0}}"
STOPS = {
    "at once": '<BehaviorTree ID="stop_here"><rover.look/></BehaviorTree>',
    "never": '<BehaviorTree ID="stop_here"><Sleep msec="1000"/></BehaviorTree>',
    "without": "",
}
NEEDS = '<BehaviorTree ID="ready"><Needs name="it is used" if="rover.wheels == USED" otherwise="\'it is not\'"/></BehaviorTree>'


class Host:
    """A mission over a world whose clock moves in each turn by 0.1 s, up to a moment; the wall clock always does."""

    def __init__(self, folder: Path, beside: str, body: str = "<rover.drive/>", stands_s: float = 5.0) -> None:
        (file,) = check_texts([ModelFile("rover.rl", MODEL)])
        text = f'<root BTCPP_format="4" main_tree_to_execute="m"><BehaviorTree ID="m">{body}</BehaviorTree>{beside}</root>'
        (folder / "m.xml").write_text(text, encoding="utf-8")
        (folder / "mock.yaml").write_text(MOCK, encoding="utf-8")
        self.out = folder / "run"
        self.out.mkdir()
        plan = plan_of_file(folder / "m.xml", "m", file.skillsets, {}, NO_PART)
        self.world, _ = mock_world(file.skillsets, load_behaviour([folder / "mock.yaml"], file.skillsets), seed=0, latency_s=0.0)
        clock_ns = lambda: self.world.clock.now_ns  # noqa: E731
        record = MissionRecord(self.out, plan, clock_ns, {})
        client = lambda name, wake: MissionClient(self.world.client(name), wake, record)  # noqa: E731
        self.driver = MissionDriver(plan, client, clock_ns, {}, record=record)
        self.world.on_event(lambda _, event: self.driver.event(event))
        self.stands_s = stands_s
        self.turns = 0

    def turn(self) -> None:
        self.turns += 1
        moves = self.world.now_s < self.stands_s
        self.world.run_for(0.1 if moves else 0.0)
        if moves:
            self.driver.wake()
        if self.driver.due and self.driver.end is None:
            self.driver.tick()
            self.world.run_for(0.0)

    def run(self) -> MissionResult:
        end = run_to_the_end(self.driver, self.turn, lambda: self.world.now_s, lambda: self.turns * 0.1)
        self.driver.finish(end)
        return end

    @property
    def running(self) -> list[str]:
        return [str(execution) for managers in self.world.managers.values() for execution in managers.engine.executions]


@pytest.mark.parametrize("stop", STOPS)
def test_a_clock_that_stands_ends_the_mission_and_what_runs(stop: str, tmp_path: Path) -> None:
    host = Host(tmp_path, STOPS[stop])
    end = host.run()
    assert end.outcome is Outcome.ABORTED
    assert end.reason.startswith(STANDS)
    assert host.running == []
    written = [(entry.topic, entry.value) for entry in read_record(host.out)]
    assert [value["reason"] for topic, value in written if topic == OPERATOR] == [STANDS]
    assert [value["outcome"] for topic, value in written if topic == MISSION] == ["running", "aborted"]


def test_a_clock_that_stands_before_the_start_starts_nothing(tmp_path: Path) -> None:
    host = Host(tmp_path, NEEDS + STOPS["at once"])
    assert host.run() == MissionResult(Outcome.NOT_STARTED, STANDS)
    assert host.turns * 0.1 >= STANDS_S
    assert host.running == []


def test_a_clock_that_goes_on_is_waited_for(tmp_path: Path) -> None:
    host = Host(tmp_path, STOPS["at once"], stands_s=1e9)
    assert host.run().outcome is Outcome.ACCOMPLISHED
    assert host.world.now_s > STANDS_S
