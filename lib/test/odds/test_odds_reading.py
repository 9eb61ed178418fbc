"""The figures in a robot's file of faults: read with their units, and what is wrong is told with file, line and column."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest

from alula.check.robot import models_of as models_of_robot
from alula.common.robots import load_robot_folder
from alula.odds.errors import OddsError
from alula.odds.figures import ANY_RATE, NEVER, FaultFigures, Figures, Range, SkillFigures, point
from alula.odds.reading import load_figures
from alula.odds.robot import figures_of
from alula.odds.system import DEPARTURE
from alula.records.causes.fault_file import load_effects
from alula.records.models import models_of

ALULA_ROOT = Path(__file__).resolve().parents[3]
DRONE = models_of(["navigation", "perception", "mapping", "video"])

EXAMPLE = """
faults:
  zed:
    states: {perception.zed_status: BROKEN}
    happens: [1 to 3 per 1000 h, 0.2 % at departure, 0.01 per use of perception.zed_depthmap]
    lasts: 30 s
    source: maker's data sheet, table 3
  pilot: {happens: never, lasts: for ever, source: none is there}
  lidar: {}
processes:
  zed_depth: {happens: "1 per 500 h, in 4 stages", source: log of crashes}
skills:
  navigation.goto:
    results: {ARRIVED: 0.97, BLOCKED: 1 to 3 %}
    lasts: 0.1 to 0.2 min, in 20 stages
    fails: {ABORTED: 1 per 200 h}
    source: flights of 2025
"""


def read(folder: Path, text: str) -> Figures:
    path = folder / "faults.yaml"
    path.write_text(text, encoding="utf-8")
    return load_figures(path, DRONE)


def test_figures_are_read_with_units(tmp_path: Path) -> None:
    figures = read(tmp_path, EXAMPLE)
    zed = figures.faults["zed"]
    assert zed.rate == Range(Fraction(1, 3_600_000), Fraction(3, 3_600_000))
    assert zed.chances == {DEPARTURE: point("0.002"), "perception.zed_depthmap": point("0.01")}
    assert (zed.lasts, zed.source) == (point(30), "maker's data sheet, table 3")
    assert figures.faults["pilot"] == FaultFigures(rate=NEVER, lasts=None, source="none is there")
    assert figures.faults["zed_depth"] == FaultFigures(rate=point(Fraction(1, 1_800_000)), stages=4, source="log of crashes")
    # A missing figure is no guess.
    assert figures.faults["lidar"] == figures.fault("radio") == FaultFigures(rate=ANY_RATE, lasts=ANY_RATE)
    results = {"ARRIVED": point("0.97"), "BLOCKED": Range(Fraction(1, 100), Fraction(3, 100))}
    fails = {"ABORTED": point(Fraction(1, 720_000))}
    assert figures.skills == {"navigation.goto": SkillFigures(results, Range(Fraction(6), Fraction(12)), 20, fails, "flights of 2025")}
    assert read(tmp_path, "") == Figures()


def test_what_reads_effects_reads_the_same_file(tmp_path: Path) -> None:
    read(tmp_path, EXAMPLE)
    effects = load_effects(tmp_path / "faults.yaml", DRONE).known
    assert set(effects) == {"zed", "pilot", "lidar", "zed_depth"}
    assert effects["zed"].states == {"perception.zed_status BROKEN"}


@pytest.mark.parametrize(
    ("text", "place", "complaint"),
    [
        ("faults:\n  zed: {happens: 1 per 500 h}", "2:18", "`happens` of `zed` is a figure: say where it comes from, as `source: flights"),
        ("transitions:\n  video.link GONE: {}", "2:20", "there is no state `video.link GONE` of a resource; there are"),
        ("faults:\n  zed: {happens: often, source: x}", "2:18", "`often` should be as `1 per 500 h` or `1 to 3 per 1000 h`, `0.01 per use"),
        ("faults:\n  zed: {happens: 0.1, source: x}", "2:18", "`0.1` should be as `1 per 500 h`"),
        ("faults:\n  zed: {happens: 1 per 0 h, source: x}", "2:18", "`1 per 0 h`: no time has no rate"),
        ("faults:\n  zed: {happens: 2 at departure, source: x}", "2:18", "`2 at departure` is more than 1; write a chance from 0 to 1"),
        ("faults:\n  zed: {happens: [1 per 5 h, 1 per 6 h], source: x}", "2:30", "`zed` has a rate already; add the two up"),
        ("faults:\n  zed: {happens: 0.1 per use of video.steam, source: x}", "2:18", "there is no skill `video.steam`; there are"),
        ("faults:\n  zed: {lasts: 30, source: x}", "2:16", "`30` should be a time with its unit (ms, s, min, h, d), as `30 s`"),
        ("faults:\n  zed: {lasts: 0 s, source: x}", "2:16", "`0 s`: what lasts takes some time"),
        ("faults:\n  zed: {lasts: 5 to 4 s, source: x}", "2:16", "`5 to 4 s` goes from 5 down to 4; write the smaller number first"),
        ("faults:\n  zed: {lasts: '5 s, in 0 stages', source: x}", "2:16", "`5 s, in 0 stages`: a time has from 1 to 100 stages"),
        ("skills:\n  navigation.got: {}", "2:19", "there is no skill `navigation.got`; there are"),
        (
            "skills:\n  navigation.goto: {results: {ARIVED: 1}, source: x}",
            "2:39",
            "navigation.goto has no result `ARIVED`; it has ARRIVED,",
        ),
        ("skills:\n  navigation.goto: {results: {ARRIVED: 98}, source: x}", "2:40", "`98` is more than 1"),
        ("skills:\n  navigation.goto: {results: {ARRIVED: most}, source: x}", "2:40", "`most` should be a chance from 0 to 1, or in %"),
        (
            "skills:\n  navigation.goto:\n    results: {ARRIVED: 0.9, BLOCKED: 0.2}\n    source: x",
            "3:14",
            "the likelihoods of the results of `navigation.goto` can't add up to 1",
        ),
        ("skills:\n  navigation.goto: {fails: {ABORTED: 0.1}, source: x}", "2:38", "`0.1` should be as `1 per 500 h`"),
    ],
)
def test_what_is_wrong_is_told_with_its_place_and_the_cure(text: str, place: str, complaint: str, tmp_path: Path) -> None:
    with pytest.raises(OddsError) as caught:
        read(tmp_path, text)
    assert str(caught.value).startswith(f"{tmp_path / 'faults.yaml'}:{place}: {complaint}")


def test_figures_of_a_fleet_are_those_of_its_robots() -> None:
    drone, fleet = load_robot_folder(ALULA_ROOT), load_robot_folder(ALULA_ROOT / "examples/two_robots")
    own, theirs = (figures_of(one, models_of_robot(one, pytest.fail)) for one in (drone, fleet))
    assert own.faults
    assert {what: theirs.faults[f"drone_{what}"] for what in own.faults} == own.faults
    assert {skill: theirs.skills[f"drone_{skill}"] for skill in own.skills} == own.skills


def test_what_uses_are_is_named_with_the_skills() -> None:
    fault = FaultFigures(chances={DEPARTURE: NEVER, "arm.grip": NEVER})
    named = Figures({"grease": fault}, {"arm.grip": SkillFigures()}).named("left_{}".format)
    assert (list(named.faults), list(named.skills)) == (["left_grease"], ["left_arm.grip"])
    assert list(named.faults["left_grease"].chances) == [DEPARTURE, "left_arm.grip"]
