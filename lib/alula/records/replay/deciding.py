"""Decides a recorded mission again, as it was or with one thing changed: the steps of a replay that need no measurements and no report.

1. ``read_mission``: the record, the mission's tree and models, or others, and the mocks that answer what was not recorded.
2. ``decide``: what was recorded happens again, and the tree decides.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from alula.common.record import Entry
from alula.missions.plan import MissionPlan
from alula.missions.record import MissionRecord
from alula.mock import Behaviour
from alula.model.model import Skillset
from alula.records.replay.recorded import Recorded, ReplayError
from alula.records.replay.replay import Replay, Result
from alula.records.replay.request import behaviour_for, faults_for, parameters_for, plan_for, skillsets_for
from alula.records.replay.robot import RecordedSkills, ReplayedRobot

BAG = "functional.bag"


@dataclass(frozen=True)
class RecordedMission:
    """What is decided again: the record, its plan or another one, the models, and what mocks do where nothing was recorded."""

    recorded: Recorded
    plan: MissionPlan
    skillsets: Sequence[Skillset]
    behaviour: Behaviour


RobotAndInputs = tuple[ReplayedRobot, Iterable[Entry]]
"""The robot under the tree, and the entries that are inputs of the tree, in the order of time."""
MakeRobot = Callable[[RecordedMission], RobotAndInputs]


@dataclass(frozen=True)
class Conditions:
    """Under which conditions it is decided again.

    Attributes:
        make_robot: makes the robot under the tree and its inputs, such as real hooks over the functional layer's bag; None: the skills end
            as they did.
        fail: what did not fail then, as on the command line.
        settings: other parameters of the mission, ``NAME=VALUE``.
        go_on: go on over mocks after the first difference.
        rate: mission clock a second at most; 0: no limit.
        out: folder of the replay's own record; None: it leaves none.
    """

    make_robot: MakeRobot | None = None
    fail: Sequence[str] = ()
    settings: Sequence[str] = ()
    go_on: bool = False
    rate: float = 0.0
    out: Path | None = None


def read_mission(recorded: Recorded, *, tree: str = "", models: Sequence[Path] = (), behaviour: Sequence[Path] = ()) -> RecordedMission:
    """Return a recorded mission with another tree, other models, or more behaviour of the mocks; raises ReplayError."""
    if not recorded.decisions and not recorded.whole:
        raise ReplayError(f"{recorded.path}: breaks off before the mission's first decision; there is nothing to hold a replay against")
    plan = plan_for(recorded, tree)
    skillsets = skillsets_for(plan, models)
    return RecordedMission(recorded, plan, skillsets, behaviour_for(recorded, skillsets, behaviour))


def bag_of(recorded: Recorded, given: Path) -> Path:
    """Return the bag that was given, or the one beside the record; raises ReplayError."""
    path = given if given.suffix == ".bag" else recorded.path.parent / BAG
    if not path.is_file():
        raise ReplayError(f"{path}: there is no such bag; a run over mocks has none, replay it with --from skills")
    return path


def decide(mission: RecordedMission, conditions: Conditions) -> Result:
    """Make the mission's decisions again under the conditions; return them with the first difference.

    Raises:
            ReplayError: the conditions do not fit the record, or its folder can't be written.
    """
    recorded, plan, out = mission.recorded, mission.plan, conditions.out
    parameters = parameters_for(recorded, plan, conditions.settings)
    faults = faults_for(mission.behaviour, conditions.fail)
    robot, entries = (conditions.make_robot or recorded_skills)(mission)
    for fault in faults:
        robot.fail(fault)
    make_record = None
    if out is not None:
        _make_folder(out)
        make_record = lambda clock_ns: MissionRecord(out, plan, clock_ns, parameters)  # noqa: E731
    replay = Replay(recorded, robot, entries, plan, parameters=parameters, go_on=conditions.go_on, record=make_record, rate=conditions.rate)
    return replay.run()


def recorded_skills(mission: RecordedMission) -> RobotAndInputs:
    """Have the skills end as they did."""
    recorded = mission.recorded
    return RecordedSkills(mission.skillsets, recorded, mission.behaviour, start_s=recorded.begun_s), recorded.entries


def _make_folder(out: Path) -> None:
    try:
        out.mkdir(parents=True, exist_ok=True)
        if any(out.iterdir()):
            raise ReplayError(f"--out {out}: is not empty; choose another, a replay never overwrites")
    except OSError as error:
        raise ReplayError(f"--out {out}: {error.strerror}") from error
