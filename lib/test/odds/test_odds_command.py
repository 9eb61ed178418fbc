"""The command: a mission's own tree with its own models, exactly; with faults; and what is wrong in one line."""

from __future__ import annotations

import builtins
import json
import shutil
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from fetch_and_carry import by_hand

from alula.cli.odds import main

CARRIER = Path(__file__).parent / "carrier"


@pytest.fixture
def carrier(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    shutil.copytree(CARRIER, tmp_path / "carrier")
    monkeypatch.setenv("ALULA_ROBOT", str(tmp_path / "carrier"))
    return tmp_path / "carrier"


def odds(capsys: pytest.CaptureFixture[str], *words: str | Path) -> Mapping[str, dict]:  # type: ignore[type-arg]
    code = main([*map(str, words), "--json"])
    said = capsys.readouterr()
    assert code == 0, said.err
    found: Mapping[str, dict] = json.loads(said.out)  # type: ignore[type-arg]
    return found


def exactly(found: Mapping[str, dict], outcome: str) -> tuple[Fraction, Fraction]:  # type: ignore[type-arg]
    least, most = found["outcomes"][outcome]["exact"]
    return Fraction(least), Fraction(most)


@pytest.mark.parametrize(("mission", "attempts"), [("once", 1), ("retry", 5)])
def test_a_tree_of_skills_has_the_chance_that_is_derived_by_hand(
    mission: str, attempts: int, carrier: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = odds(capsys, carrier / f"missions/{mission}.xml")
    assert exactly(found, "accomplished") == (by_hand(attempts),) * 2
    assert exactly(found, "given_up") == (1 - by_hand(attempts),) * 2
    assert exactly(found, "neither") == exactly(found, "degraded") == (0, 0)
    assert found["open"] == 0


def test_the_mean_time_is_that_of_the_skills_that_run(carrier: Path, capsys: pytest.CaptureFixture[str]) -> None:
    # Drive; with 0.7 pick; with 0.7 * 0.6 drive again; with 0.294 put.
    found = odds(capsys, carrier / "missions/once.xml")
    expected_s = 20 + 0.7 * 5 + 0.42 * 20 + 0.294 * 5
    assert found["seconds"] == pytest.approx([expected_s] * 2)


OWN = """
from alula import trees
from alula.parts import MissionPart


@trees.register("robot.Counted")
class Counted(trees.Decorator):
    ports = (trees.input_port("many", trees.INT),)
    remembers = ("_count",)

    def setup(self):
        self._count = 0

    def update(self):
        if self._count >= self.number("many"):
            return trees.SUCCESS
        answer = self.child.execute()
        self._count += answer is trees.SUCCESS
        return trees.RUNNING if answer is trees.SUCCESS else answer


@trees.register("robot.Near")
class Near(trees.Control):
    ports = (trees.input_port("seen", trees.ANY),)

    def update(self):
        return self.children[0 if self.get("seen")["x"] < 3 else 1].execute()


PART = MissionPart((Counted, Near))
"""
COUNTED = '<robot.Counted many="MANY"><carrier.pick/></robot.Counted>'
NEAR = '<robot.Near seen="{seen}"><carrier.pick/><AlwaysSuccess/></robot.Near>'


@pytest.mark.parametrize(
    ("inside", "exact"), [(COUNTED.replace("MANY", "1"), True), (COUNTED.replace("MANY", "{many}"), False), (NEAR, False)]
)
def test_a_class_with_children_that_meets_a_value_that_nobody_knows_makes_bounds(
    inside: str,
    exact: bool,  # noqa: FBT001
    carrier: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (carrier / "code").mkdir()
    (carrier / "code/counting_nodes.py").write_text(OWN, encoding="utf-8")
    (carrier / "robot.yaml").write_text("name: carrier\npython: [code]\nparts: {missions: 'counting_nodes:PART'}\n", encoding="utf-8")
    model, mission = carrier / "skillsets/carrier.skill", carrier / "missions/own.xml"
    outputs = "output {\n      many: int32\n      seen: Spot\n    }\n    result {\n      success ARRIVED"
    model.write_text(
        "type Spot\n" + model.read_text(encoding="utf-8").replace("result {\n      success ARRIVED", outputs), encoding="utf-8"
    )
    (carrier / "skillsets/types.yaml").write_text("Spot: geometry_msgs/Point\n", encoding="utf-8")
    drive = '<carrier.drive place="0" many="{many}" seen="{seen}"/>'
    tree = f'<BehaviorTree ID="own"><SequenceWithMemory>{drive}{inside}</SequenceWithMemory></BehaviorTree>'
    mission.write_text(f'<root BTCPP_format="4" main_tree_to_execute="own">{tree}</root>', encoding="utf-8")
    assert main([str(mission), "--json"]) == 0
    said = capsys.readouterr()
    least, most = (Fraction(one) for one in json.loads(said.out)["outcomes"]["accomplished"]["exact"])
    if exact:
        assert least == most == Fraction(7, 10) * Fraction(6, 10)
        assert said.err == ""
    else:
        assert (least, most) == (0, Fraction(7, 10)), "it may fail at once, or succeed without its child; no drive, no success"
        assert "own.xml:1:" in said.err
        assert "may tick and halt its children in any order" in said.err
        assert "is not known" in said.err


WHEEL = """
faults:
  wheel:
    ends: {carrier.drive: STUCK}
    happens: 1 per 100 s
    lasts: for ever
    source: made up
"""


def with_a_wheel(carrier: Path) -> None:
    """Have a wheel that comes off while it drives; it can do that at any time, and costs where it drives."""
    path = carrier / "skillsets/faults.yaml"
    text = (
        path.read_text(encoding="utf-8")
        .replace("{ARRIVED: 0.7, STUCK: 0.3}", "{ARRIVED: 1}")
        .replace("{PICKED: 0.6, MISSED: 0.4}", "{PICKED: 1}")
    )
    path.write_text(WHEEL.lstrip() + text, encoding="utf-8")


def test_a_fault_costs_and_a_second_unit_brings(carrier: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with_a_wheel(carrier)
    found = odds(capsys, carrier / "missions/once.xml", "--with", "wheel=2", "--with", "wheel=never")
    # It comes before the end of a drive of 20 s with 20/120, and stops it; before that of a pick of 5 s with 5/105. Then the drive
    # after it may be stopped, or not: nobody says.
    least, most = exactly(found, "accomplished")
    drive, pick = Fraction(100, 120), Fraction(100, 105)
    assert least == drive * pick * drive
    assert most == drive * (pick * drive + 1 - pick)
    second, never = (exactly(found["with"][change], "accomplished") for change in ("wheel=2", "wheel=never"))
    assert least < second[0] < never[0] == 1
    (cost,) = (one for one in found["costs"] if one["name"] == "wheel")
    assert cost["without"] == pytest.approx(float(1 - least))
    assert cost["slope"] < 0


def test_the_slope_is_the_derivative(carrier: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with_a_wheel(carrier)
    path, mission = carrier / "skillsets/faults.yaml", carrier / "missions/once.xml"
    text = path.read_text(encoding="utf-8")
    slope = next(one["slope"] for one in odds(capsys, mission)["costs"] if one["name"] == "wheel")
    around = []
    for rate in ("0.999", "1.001"):
        path.write_text(text.replace("1 per 100 s", f"{rate} per 100 s"), encoding="utf-8")
        around.append(float(exactly(odds(capsys, mission), "accomplished")[0]))
    assert slope == pytest.approx((around[1] - around[0]) / (0.002 * 36), rel=1e-5)


def test_what_nobody_knows_makes_a_range_and_a_search_that_stops_holds(carrier: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole = exactly(odds(capsys, carrier / "missions/once.xml"), "accomplished")
    stopped = odds(capsys, carrier / "missions/once.xml", "--most", "9")
    least, most = exactly(stopped, "accomplished")
    assert stopped["open"] > 0
    assert least <= whole[0] <= most
    assert least < most
    (carrier / "skillsets/faults.yaml").unlink()
    assert exactly(odds(capsys, carrier / "missions/once.xml"), "accomplished") == (0, 1)


def test_what_has_no_figures_is_named_with_where_they_are_written(carrier: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert odds(capsys, carrier / "missions/once.xml")["lacking"] == []
    path = carrier / "skillsets/faults.yaml"
    known = path.read_text(encoding="utf-8")
    wheel = "faults:\n  wheel: {ends: {carrier.drive: STUCK}}\n"
    path.write_text(wheel + known.replace("{PICKED: 0.6, MISSED: 0.4}", "{}"), encoding="utf-8")
    assert odds(capsys, carrier / "missions/once.xml")["lacking"] == ["carrier.pick", "wheel"]
    path.write_text(wheel, encoding="utf-8")
    assert main([str(carrier / "missions/once.xml")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "  accomplished       0 to 1" in lines
    why = lines.index("no figures for carrier.drive, carrier.pick, carrier.put, wheel: their chances count as anything from 0 to 1")
    assert lines[why + 1] == "write them in the robot's `faults.yaml`, under `faults`, `transitions` and `skills` (docs/how-to/odds.md)"


def test_the_text_and_the_picture(carrier: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "odds.svg"
    assert main([str(carrier / "missions/retry.xml"), "--svg", str(picture)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == ["retry.xml: odds", "  accomplished       0.9516486"]
    assert "  given up in order  0.0483514" in lines
    words = [one.text for one in ET.parse(picture).iter("{http://www.w3.org/2000/svg}text")]  # noqa: S314 - our own
    assert words[:3] == ["retry.xml: odds", "accomplished", "0.9516486"]


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["missions/nosuch.xml"], "missions/nosuch.xml"),
        (["missions/once.xml", "--most", "0"], "--most 0: is a number of situations, from 1 on"),
        (["missions/once.xml", "--with", "wheel"], "--with wheel: write FAULT=UNITS"),
        (["missions/once.xml", "--with", "wheel=0"], "--with wheel=0: write FAULT=UNITS"),
        (["missions/once.xml", "--with", "wheel=2"], "--with wheel=2: no fault `wheel` can come in this mission; there are none"),
    ],
)
def test_what_is_wrong_is_one_line_and_exit_code_2(
    words: list[str], complaint: str, carrier: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(carrier)
    assert main(words) == 2
    said = capsys.readouterr()
    assert (said.out, said.err.count("\n")) == ("", 1)
    assert complaint in said.err


def test_without_storm_one_line_says_what_brings_it(
    carrier: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    imported = builtins.__import__

    def no_storm(name: str, *rest: object, **named: object) -> object:
        if name == "stormpy":
            raise ModuleNotFoundError(name)
        return imported(name, *rest, **named)  # type: ignore[arg-type]

    monkeypatch.setattr(builtins, "__import__", no_storm)
    assert main([str(carrier / "missions/once.xml")]) == 2
    assert capsys.readouterr().err == (
        "alula odds: needs the Python package stormpy (the model checker Storm): pip install 'alula[odds]' brings it\n"
    )
