"""Runs of missions that ask data: what is found, that it plays, and that the search asks of data what scripts do."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("z3")
pytest.importorskip("py_trees")

from alula.common.record import DATA as DATA_TOPIC
from alula.common.record import read_record
from alula.language.models import ModelFile, check_texts
from alula.missions.context import MissionContext
from alula.missions.director import Outcome
from alula.missions.environment import MissionEnvironment
from alula.missions.mission_file import MissionFile
from alula.missions.part import NO_PART
from alula.missions.pending import PendingInterrupts
from alula.model.model import Skillset
from alula.prove.mission.fitting import agree, told
from alula.prove.mission.measured import Conditions, Kind, Measurements
from alula.prove.mission.oracle import Answer, Asked, Oracle
from alula.prove.mission.play import play
from alula.prove.mission.prover import Proved, prove_mission
from alula.prove.mission.run import MissionFinding
from alula.trees.script import parse
from alula.trees.script.scope import Unknown
from finding_pages.mission_checks import whole

MODEL = """
type Battery
skillset rover {
  data battery: Battery period 1 sec
  data mode: string
  data level: float64 period 1 sec
  data docked: bool
  resource wheels { state { FREE USED } initial FREE transition { FREE -> USED USED -> FREE } }
  skill drive { success ARRIVED {} failure BLOCKED {} }
  skill charge { success FULL {} }
}
"""


def skillsets() -> tuple[Skillset, ...]:
    (file,) = check_texts([ModelFile("rover.rl", MODEL)])
    return tuple(file.skillsets)


def proved(inside: str, folder: Path) -> tuple[Path, Proved]:
    path = folder / "mission.xml"
    path.write_text(whole(inside))
    return path, prove_mission(MissionFile.read(path, skillsets(), NO_PART))


WAITS = '<WaitFor name="full" if="rover.battery.level &gt; 0.8"/>'


def test_a_mission_that_waits_for_ever_while_the_battery_stays_low_is_told_and_plays(tmp_path: Path) -> None:
    path, known = proved(f"<Sequence><rover.charge/>{WAITS}</Sequence>", tmp_path)
    (finding,) = known.findings
    assert known.complete
    assert isinstance(finding, MissionFinding)
    assert finding.code == "ALU704"
    assert finding.message.endswith("for ever, though nothing fails any more: active('full'), rover.battery.level is <= 0.8")
    assert finding.run is not None
    (tmp_path / "run").mkdir()
    played = play(MissionFile.read(path, finding.run.skillsets, NO_PART), finding.run, tmp_path / "run")
    assert (played.left, played.end.outcome) == ("", Outcome.ABORTED)
    (measured,) = [entry.value for entry in read_record(tmp_path / "run") if entry.topic == DATA_TOPIC]
    assert measured["data"] == "battery"
    assert measured["value"]["level"] <= 0.8


@pytest.mark.parametrize(
    "inside",
    [
        f'<Timeout msec="5000">{WAITS}</Timeout>',
        "<WaitFor if=\"!fresh(rover.mode) || rover.mode == 'AUTO' || rover.mode != 'AUTO'\"/>",
    ],
)
def test_a_wait_that_ends_whatever_the_data_is_not_told(inside: str, tmp_path: Path) -> None:
    _, known = proved(f"<Sequence><rover.charge/>{inside}</Sequence>", tmp_path)
    assert known.complete
    assert "ALU704" not in {one.code for one in known.findings}


def test_a_branch_that_thresholds_make_unreachable_is_told(tmp_path: Path) -> None:
    inside = """<Fallback>
      <ScriptCondition code="rover.level &lt; 0.5"/>
      <Sequence>
        <ScriptCondition name="lower" code="rover.level &lt; 0.2"/>
        <rover.drive name="never"/>
      </Sequence>
      <AlwaysSuccess/>
    </Fallback>"""
    _, known = proved(inside, tmp_path)
    assert [one.code for one in known.findings] == ["ALU703"]
    assert "'never' is never ticked" in known.findings[0].message
    _, known = proved(inside.replace("0.2", "0.7"), tmp_path)
    assert known.findings == []


def test_what_follows_from_data_plays_to_the_same_end(tmp_path: Path) -> None:
    """The mission gives up with a battery between two thresholds alone, while the mode is neither of two, and the robot not docked."""
    path, known = proved(
        """<Fallback _description="property kept: never outcome given_up">
          <rover.drive/>
          <ScriptCondition code="rover.battery.level &lt;= 0.15 || rover.battery.level &gt; 0.2"/>
          <ScriptCondition code="!fresh(rover.battery) || rover.docked"/>
          <ScriptCondition code="rover.mode == 'AUTO' || rover.mode == 'HAND'"/>
        </Fallback>""",
        tmp_path,
    )
    (finding,) = [one for one in known.findings if isinstance(one, MissionFinding)]
    assert finding.code == "ALU714"
    assert finding.run is not None
    played = play(MissionFile.read(path, finding.run.skillsets, NO_PART), finding.run)
    assert (played.left, played.end.outcome) == ("", Outcome.GIVEN_UP)


def test_a_play_without_the_data_leaves_the_counterexample(tmp_path: Path) -> None:
    path, known = proved('<Sequence><WaitFor if="rover.level &gt; 0.5"/><rover.drive/></Sequence>', tmp_path)
    (finding,) = [one for one in known.findings if one.code == "ALU702"]
    assert isinstance(finding, MissionFinding)
    assert finding.run is not None
    assert play(MissionFile.read(path, finding.run.skillsets, NO_PART), finding.run).left == ""
    events = tuple(
        one._replace(choices=tuple(choice for choice in one.choices if choice.question[0] != "data")) for one in finding.run.events
    )
    other = finding.run.__class__(events, *vars_of(finding))
    assert "at step" in play(MissionFile.read(path, other.skillsets, NO_PART), other).left


def vars_of(finding: MissionFinding) -> tuple[str, tuple[tuple[str, str], ...], tuple[Skillset, ...]]:
    assert finding.run is not None
    return finding.run.outcome, finding.run.states, finding.run.skillsets


PROPERTY = '<Sequence _description="property done: eventually outcome accomplished or outcome given_up assuming termination">{}</Sequence>'


def test_what_must_come_is_looked_at_while_data_stay_as_they_are(tmp_path: Path) -> None:
    path, known = proved(PROPERTY.format(WAITS), tmp_path)
    finding = next(one for one in known.findings if one.code == "ALU714")
    assert isinstance(finding, MissionFinding)
    assert finding.run is not None
    assert play(MissionFile.read(path, finding.run.skillsets, NO_PART), finding.run).left == ""
    _, known = proved(PROPERTY.format(f'<Timeout msec="5000">{WAITS}</Timeout>'), tmp_path)
    assert known.findings == []


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("rover.level * 2 &gt; 1", "`rover.level * 2 > 1`: computes with the data rover.level"),
        ("rover.level &lt; rover.battery.level", "compares the data rover.level with the data rover.battery.level"),
        ("rover.wheels == FREE ? rover.level : 0", "is neither true nor false, but a float64"),
        ("seen := rover.level", "computes with the data rover.level"),
        ("rover.battery.state || rover.battery.state == 2", "is asked as a number, and as a flag elsewhere"),
    ],
)
def test_what_computes_with_data_is_told_with_its_place(code: str, said: str, tmp_path: Path) -> None:
    tag = "Script" if ":=" in code else "ScriptCondition"
    _, known = proved(f'<Sequence>\n<{tag} code="{code}"/><rover.drive/></Sequence>', tmp_path)
    (finding,) = known.findings
    assert finding.code == "ALU711"
    assert "its runs can't be looked at: line " in finding.message
    assert said in finding.message


# --- held against what scripts do ---------------------------------------------------------------------------------------


class Robot:
    """A client to which values are told."""

    resources: Mapping[str, str] = {}

    def __init__(self, values: Mapping[str, object]) -> None:
        self.values = values

    def value(self, data: str) -> object | None:
        return self.values.get(f"rover.{data}")


class Searched:
    """A client of the search."""

    resources: Mapping[str, str] = {}

    def __init__(self, measurements: Measurements) -> None:
        self.measurements = measurements

    def value(self, data: str) -> object | None:
        return self.measurements.value(f"rover.{data}")


class Scope:
    """The names of a script, which are those of a mission's environment."""

    enums: Mapping[str, float] = {}

    def __init__(self, client: Robot | Searched) -> None:
        data = frozenset({"rover.battery", "rover.mode", "rover.level", "rover.docked"})
        context = MissionContext(clock_ns=lambda: 0, pending=PendingInterrupts(lambda: 0, 5.0))
        self._environment = MissionEnvironment({"rover": client}, context, frozenset(), data)  # type: ignore[dict-item]

    def get(self, name: str) -> object:
        return self._environment.value(name)

    def call(self, name: str, arguments: list[object]) -> object:
        return self._environment.call(name, arguments)

    def set(self, name: str, value: object, *, create: bool) -> None:
        raise KeyError(name)


KINDS = {
    "rover.battery.level": Kind.NUMBER,
    "rover.battery.cell.volts": Kind.NUMBER,
    "rover.battery.on": Kind.FLAG,
    "rover.mode": Kind.TEXT,
    "rover.level": Kind.NUMBER,
    "rover.docked": Kind.FLAG,
}
LIMITS = (-1.5, 0.0, 0.1, 0.15, 7.0)


def script(chance: random.Random, depth: int) -> str:
    if depth:
        kind = chance.randrange(4)
        below = [script(chance, depth - 1) for _ in range(3)]
        return (
            f"({below[0]} && {below[1]})",
            f"({below[0]} || {below[1]})",
            f"!({below[0]})",
            f"({below[0]} ? {below[1]} : {below[2]})",
        )[kind]
    if chance.random() < 0.2:
        return f"fresh({chance.choice(('rover.battery', 'rover.mode', 'rover.level', 'rover.docked'))})"
    name = chance.choice(list(KINDS))
    if KINDS[name] is Kind.FLAG:
        return name
    if KINDS[name] is Kind.TEXT:
        return f"{name} {chance.choice(('==', '!='))} '{chance.choice(('AUTO', 'HAND'))}'"
    symbol = chance.choice(("<", "<=", ">", ">=", "==", "!="))
    limit = chance.choice(LIMITS)
    return chance.choice((f"{name} {symbol} {limit}", f"{limit} {symbol} {name}", f"-1 < {name} < {limit}"))


def number(chance: random.Random) -> float:
    return chance.choice((*LIMITS, *LIMITS, math.nan, -1e9, 1e9, chance.uniform(-2, 8)))


def values(chance: random.Random) -> dict[str, object]:
    battery = SimpleNamespace(level=number(chance), on=chance.random() < 0.5, cell=SimpleNamespace(volts=number(chance)))
    known = {
        "rover.battery": battery,
        "rover.mode": chance.choice(("AUTO", "HAND", "", "another")),
        "rover.level": number(chance),
        "rover.docked": chance.random() < 0.5,
    }
    return {name: value for name, value in known.items() if chance.random() < 0.8}


def said(text: str, client: Robot | Searched) -> object:
    answer = parse(text).judge(Scope(client))  # type: ignore[arg-type]
    return None if isinstance(answer, Unknown) else answer


def branches(text: str, conditions: Conditions) -> Iterator[tuple[object, tuple[Asked, ...]]]:
    """Yield what a script answers in each way in which the search lets data be, with what it has asked of them."""
    oracle = Oracle()
    todo: list[tuple[Answer, ...]] = [()]
    while todo:
        before = todo.pop()
        oracle.begin(lambda _: None, before)
        answer = said(text, Searched(Measurements(oracle, conditions)))
        yield answer, tuple(oracle.asked)
        given = tuple(one.answer for one in oracle.asked)
        todo += [(*given[:place], True) for place in range(len(before), len(given)) if oracle.asked[place].answer is False]


def flat(known: Mapping[str, object]) -> dict[str, object]:
    """Return values by the names of fields, as questions name them."""
    found: dict[str, object] = {f"{name} fresh": name in known for name in ("rover.battery", "rover.mode", "rover.level", "rover.docked")}
    for name in KINDS:
        value: object = known.get(".".join(name.split(".")[:2]))
        for part in name.split(".")[2:]:
            value = getattr(value, part, None)
        value = float(value) if isinstance(value, bool) else value
        found[name] = None if isinstance(value, float) and math.isnan(value) else value
    return found


@pytest.mark.parametrize("seed", range(60))
def test_each_value_is_one_way_of_the_search_and_each_way_has_a_value(seed: int) -> None:
    chance = random.Random(seed)  # noqa: S311 - for tests
    text = f"{script(chance, 2)} && {script(chance, 1)}"
    kinds = {name: kind for name, kind in KINDS.items() if name in text}
    fresh = frozenset(name for name in ("rover.battery", "rover.mode", "rover.level", "rover.docked") if f"fresh({name})" in text)
    ways = list(branches(text, Conditions(kinds, fresh)))
    for answer, choices in ways:
        fitting = told(choices)
        assert fitting is not None, choices
        assert said(text, Robot(fitting)) == answer, choices
    single = {data for name in kinds if [one.split(".")[1] for one in kinds].count(data := name.split(".")[1]) == 1} - {
        one.split(".")[1] for one in fresh
    }
    for _ in range(40):
        known = values(chance)
        now = flat(known)
        for name, kind in kinds.items():  # of one number alone, none and a stale one are the same
            if name.split(".")[1] in single and kind is Kind.NUMBER and now[name] is None:
                now[f"rover.{name.split('.')[1]} fresh"] = False
        fitting_ways = [answer for answer, choices in ways if agree(now, choices)]
        assert fitting_ways == [said(text, Robot(known))]
