"""The supervisor's view of roslaunch's processes."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace

from alula.report.deaths import read_deaths
from alula_flight.deaths import Consequence, DeathRecord
from alula_flight.supervisor import MissionClock, Watch


@dataclass
class StartingLaunch:
    """Stands for roslaunch while it starts: a process dies before ``start`` has returned."""

    listener: Watch
    pm: SimpleNamespace = field(default_factory=lambda: SimpleNamespace(get_process=lambda _: SimpleNamespace(spawn_count=1)))

    def start(self) -> None:
        self.listener.process_died("uav_simulator-2", 1)


def test_a_death_while_roslaunch_still_starts_is_noted(tmp_path: Path) -> None:
    watch = Watch(DeathRecord(tmp_path / "deaths.jsonl"), MissionClock(simulated=True))
    launch = StartingLaunch(watch)
    watch.follow(launch)
    launch.start()
    assert [death.name for death in read_deaths(tmp_path / "deaths.jsonl")] == ["uav_simulator"]
    assert watch.worst is not Consequence.GO_ON
