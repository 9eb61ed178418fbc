"""The judge of flights: what it reads of the simulator's truth, and that it finds each thing that is wrong with a flight."""

from __future__ import annotations

import json
import math
import struct
from dataclasses import replace
from pathlib import Path

import pytest
from flight_judge.__main__ import WORDS, main
from flight_judge.truth import Broken, Truth, at_rest, truth_of
from flight_judge.verdicts import Claim, Verdict, claim_of, judge, read_words, with_radio
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

from alula.campaign.plan import load_campaign
from alula.common.scenarios import load_scenario

CAMPAIGNS = Path(__file__).resolve().parent / "campaigns"
LIFT_OFF_S = 5.0
GOOD = Truth(LIFT_OFF_S, 0, "", 1.2, at_rest=True, broken=(Broken("zed", "dead", 6.0, 20.0),))
CLAIM = Claim("degraded", "perception.zed_depthmap: RESOURCE_INVARIANT_VIOLATED zed_ok (zed_status is BROKEN)", 6.4)


def write_bag(path: Path, heights_m: list[float], state: dict[str, object]) -> None:
    """Write a bag with a pose each 0.1 s and the simulator's last word."""
    store = get_typestore(Stores.ROS1_NOETIC)
    types = store.types
    time, header = types["builtin_interfaces/msg/Time"], types["std_msgs/msg/Header"]
    with Writer(path) as bag:
        poses = bag.add_connection("/sim/true_pose", "geometry_msgs/msg/PoseStamped", typestore=store)
        states = bag.add_connection("/sim/state", "std_msgs/msg/String", typestore=store)
        for number, height_m in enumerate(heights_m):
            stamp_ns = number * 100_000_000
            pose = types["geometry_msgs/msg/Pose"](
                types["geometry_msgs/msg/Point"](1.0, 2.0, height_m), types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
            )
            stamped = types["geometry_msgs/msg/PoseStamped"](header(0, time(stamp_ns // 10**9, stamp_ns % 10**9), "map"), pose)
            bag.write(poses, stamp_ns, store.serialize_ros1(stamped, "geometry_msgs/msg/PoseStamped"))
        text = types["std_msgs/msg/String"](json.dumps(state))
        bag.write(states, stamp_ns, store.serialize_ros1(text, "std_msgs/msg/String"))


def flight(folder: Path, heights_m: list[float], **state: object) -> Truth:
    """Return the truth of a flight with a broken ZED, a process that was killed and started again, and an operator who aborts."""
    folder.mkdir(parents=True)
    sensors = [{"sensor": "zed", "mode": "dead", "t_s": 11.0}, {"sensor": "zed", "mode": "ok", "t_s": 13.0}]
    told = {"lift_off_s": LIFT_OFF_S, "collisions": 0, "crash": "", "min_clearance_m": 1.2, "faults": sensors}
    write_bag(folder / "functional.bag", heights_m, {**told, **state})
    lines = [
        {"kind": "fault", "sensor": "encoder", "mode": "killed", "t_s": 15.0},
        {"kind": "fault", "sensor": "encoder", "mode": "ok", "t_s": 16.0},
        {"kind": "act", "stamp_s": 20.0, "command": "abort", "by": "--fail", "answer": ""},
    ]
    (folder / "run_log.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines) + '{"kind": "fau', encoding="utf-8")
    return truth_of(folder)


def test_the_truth_is_the_simulators_and_of_those_who_break_things(tmp_path: Path) -> None:
    truth = flight(tmp_path / "a", [0.0] * 5 + [3.0] * 30 + [0.0] * 20, collisions=2)
    assert (truth.lift_off_s, truth.collisions, truth.at_rest, truth.ended_by) == (LIFT_OFF_S, 2, True, "")
    assert truth.broken == (Broken("zed", "dead", 6.0, 8.0), Broken("encoder", "killed", 10.0, 11.0), Broken("operator", "abort", 15.0))
    assert truth_of(tmp_path).collisions is None


@pytest.mark.parametrize(
    ("heights_m", "rests"),
    [([0.0, 3.0, *[0.1] * 15], True), ([0.0, 3.0, *[2.0] * 15], False), ([0.0, *[z * 0.02 for z in range(30)]], False), ([], None)],
)
def test_a_vehicle_is_at_rest_where_it_stands_on_the_ground(heights_m: list[float], *, rests: bool | None) -> None:
    assert at_rest([(number * 0.1, 0.0, 0.0, z) for number, z in enumerate(heights_m)]) is rests


def test_a_good_flight_has_a_true_cause_and_nothing_wrong() -> None:
    verdict = judge(CLAIM, GOOD, read_words(WORDS))
    assert (verdict.wrong, verdict.cause) == ((), "zed:dead")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"collisions": 1}, "collisions: 1"),
        ({"collisions": None}, "the simulator tells nothing"),
        ({"crash": "it met the ground at 4.0 m/s"}, "crashed: it met the ground at 4.0 m/s"),
        ({"at_rest": False}, "not at rest in the end"),
        ({"ended_by": "supervisor", "ended_why": "its limit of 180 s is over"}, "hung: its limit of 180 s is over"),
        ({"ended_by": "signal", "ended_why": "SIGTERM to alula run"}, "hung: SIGTERM to alula run"),
    ],
)
def test_each_thing_that_is_wrong_is_found(change: dict[str, object], said: str) -> None:
    assert judge(CLAIM, replace(GOOD, **change), read_words(WORDS)).wrong == (said,)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "broken",
    [
        (),
        (Broken("lidar", "dead", 6.0),),  # another thing than the one that is named
        (Broken("zed", "dead", 6.5),),  # not yet
        (Broken("zed", "dead", 0.0, 0.3),),  # not any more
    ],
)
def test_a_cause_that_was_not_in_effect_is_untrue(broken: tuple[Broken, ...]) -> None:
    (said,) = judge(CLAIM, replace(GOOD, broken=broken), read_words(WORDS)).wrong
    assert said == f"untrue cause: {CLAIM.reason}"


def test_a_run_that_its_supervisor_ends_is_over_and_its_cause_is_judged() -> None:
    words, ended = read_words(WORDS), {"ended_by": "supervisor", "ended_why": "mission died (signal SIGKILL)"}
    claim = claim_of({"outcome": "aborted", "reason": "ended by the supervisor: mission died (signal SIGKILL)"})
    killed = replace(GOOD, broken=(Broken("mission", "killed", 6.0),), **ended)  # type: ignore[arg-type]
    assert judge(claim, killed, words) == Verdict((), "mission:killed")
    assert judge(claim, replace(killed, broken=()), words).wrong == (f"untrue cause: {claim.reason}",)
    assert judge(Claim("running", "", None), GOOD, words).wrong == ("never over: running",)
    assert judge(Claim("None", "", None), killed, words) == Verdict((), "mission:killed"), "what is lost of its files says the log"


def test_a_failure_may_be_told_some_ticks_of_the_clock_early() -> None:
    assert judge(CLAIM, replace(GOOD, broken=(Broken("zed", "dead", CLAIM.failed_s + 0.04),)), read_words(WORDS)).cause == "zed:dead"  # type: ignore[operator]


def test_a_failure_that_is_told_by_a_clock_that_stood_is_judged_by_when_it_went_on() -> None:
    claim = Claim("given_up", "mapping.lidar_mapping: FAILED (the managers of mapping have gone)", 7.5)
    killed, bridge = Broken("mapping", "killed", 9.0), Broken("ros_bridge", "killed", 7.4, 12.5)
    words = {name: pattern for name, pattern in read_words(WORDS).items() if name != "ros_bridge"}
    assert judge(claim, replace(GOOD, broken=(bridge, killed)), words).cause == "mapping:killed"
    assert judge(claim, replace(GOOD, broken=(killed,)), words).cause == ""


def test_a_claim_is_the_reason_and_when_the_skill_failed_that_it_names() -> None:
    failed = {"skillset": "a", "skill": "b", "end_s": 7.0, "outcome": "FAILED", "result_kind": ""}
    other = {"skillset": "a", "skill": "c", "end_s": 3.0, "outcome": "FAILED", "result_kind": ""}
    before = {**failed, "end_s": 1.0, "result_kind": "success"}
    assert claim_of({"outcome": "given_up", "reason": "a.b: FAILED", "skills": [other, before, failed]}) == Claim(
        "given_up", "a.b: FAILED", 7.0
    )
    assert claim_of({"outcome": "aborted", "reason": "aborted by the operator"}).failed_s is None


def test_what_the_radio_suffers_is_what_was_asked_for() -> None:
    truth = with_radio(replace(GOOD, broken=()), ["radio:out@4-9", "zed@3", "control@7"])
    assert truth.broken == (Broken("radio", "out", 4.0, 9.0), Broken("control", "", 7.0, math.inf))


def test_the_drones_words_cover_all_that_its_campaigns_draw() -> None:
    words = read_words(WORDS)
    for file in ("uav-simulator.yaml", "uav-simulator-short.yaml"):
        assert {fault.what for run in load_campaign(CAMPAIGNS / file).runs for fault in run.requests} <= words.keys()
    assert words.keys() >= dict(load_scenario("inspection").faults).keys() | dict(load_scenario("mapping").faults).keys()


def test_a_drive_is_read_by_the_rovers_topics(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer(tmp_path / "functional.bag") as bag:
        poses = bag.add_connection("/truth/odom", "nav_msgs/msg/Odometry", typestore=store)
        states = bag.add_connection("/truth/state", "std_msgs/msg/String", typestore=store)
        # Serialised by hand: header, child frame, position, and zeros up to the end of the twist's covariance.
        header = struct.pack("<IIIi", 0, 7, 0, 3) + b"map" + struct.pack("<i", 0)
        bag.write(poses, 7_000_000_000, header + struct.pack("<ddd", 1.0, 2.0, 0.0) + bytes(8 * (4 + 36 + 6 + 36)))
        told = json.dumps({"departed_s": 4.0, "collisions": 1, "faults": [{"sensor": "laser", "mode": "dead", "t_s": 6.0}]})
        text = store.types["std_msgs/msg/String"](told)
        bag.write(states, 7_000_000_000, store.serialize_ros1(text, "std_msgs/msg/String"))
    truth = truth_of(tmp_path)
    assert (truth.lift_off_s, truth.collisions, truth.at_rest, truth.broken) == (4.0, 1, True, (Broken("laser", "dead", 2.0),))


def test_a_campaign_is_judged_flight_by_flight_beside_the_mocks(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    campaign = tmp_path / "c"
    flight(campaign / "run-00000", [0.0] * 5 + [3.0] * 30 + [0.0] * 20)
    flight(campaign / "run-00001", [0.0] * 5 + [3.0] * 30, collisions=1)
    summary = {"outcome": "degraded", "reason": CLAIM.reason, "skills": []}
    rows = [{"run": run, "scenario": "mapping", "seed": 3, "faults": ["zed@6-8", "camera@9"], "outcome": "degraded"} for run in (0, 1)]
    rows = [{**row, "folder": f"run-{row['run']:05d}"} for row in rows]
    for row in rows:
        (campaign / f"run-{row['run']:05d}/summary.json").write_text(json.dumps(summary), encoding="utf-8")
    (campaign / "runs.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows), encoding="utf-8")
    (campaign / "campaign.json").write_text(json.dumps({"runs": [{"world": None}, {"world": None}]}), encoding="utf-8")
    page = tmp_path / "page.md"
    page.write_text("before\n\n<!-- flights -->\nold\n<!-- /flights -->\nafter\n", encoding="utf-8")
    assert main([str(campaign), "--into", str(page)]) == 1
    assert page.read_text(encoding="utf-8").startswith("before\n\n<!-- flights -->\n\n2 flights: 2 degraded.")
    assert page.read_text(encoding="utf-8").endswith(" |\n\n<!-- /flights -->\nafter\n")
    page.write_text("no place\n", encoding="utf-8")
    assert main([str(campaign), "--into", str(page)]) == 2
    assert page.read_text(encoding="utf-8") == "no place\n"
    capsys.readouterr()
    assert main([str(campaign)]) == 1
    said = capsys.readouterr().out
    assert "| encoder | 2 killed | 1 degraded; 1 degraded, wrong |\n" in said
    assert said.startswith("2 flights: 2 degraded. A cause was told in 2, true in 2. Wrong: 1 collisions, 1 not at rest in the end.")
    first, second = map(json.loads, (campaign / "verdicts.jsonl").read_text(encoding="utf-8").splitlines())
    assert (first["wrong"], first["cause"], first["mocks"]) == ([], "zed:dead", {"outcome": "degraded", "unknown": ["camera@9"]})
    assert second["wrong"] == ["collisions: 1", "not at rest in the end"]
    assert main([str(tmp_path / "none")]) == 2
