"""``./alula conform`` on every kind of log, whole, cut off, damaged or foreign."""

from __future__ import annotations

import contextlib
import json
import os
import re
import sqlite3
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as BagWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from alula.campaign.mocked_scenarios import load_mocked_scenario
from alula.cli.conform import main
from alula.common.faults import parse_fault
from alula.common.record import EVENTS, FILE, MISSION, RecordWriter
from alula.records.logs import MESSAGE, read_log
from alula.runtime.core.events import event_record

ROOT = Path(os.environ["ALULA_ROOT"])


@pytest.fixture(scope="module")
def flown():
    flights = load_mocked_scenario("mapping")
    return flights.run([parse_fault("zed@30")]).events


def record(path, events):
    writer = RecordWriter(path)
    for event in events:
        writer.write(EVENTS, event.stamp_ns, event_record(event))
    writer.close()


def lines(path, events):
    path.write_text("".join(json.dumps(event_record(event)) + "\n" for event in events), encoding="utf-8")


DEFINITION = (ROOT / "bridge/interfaces/skillset_interfaces/msg/Event.msg").read_text(encoding="utf-8")
OF_0_3 = """
std_msgs/Header header
uint64 sequence
string skillset
uint8 EXECUTION=0
uint8 TRANSITION=1
uint8 kind
string skill
string id
string state
string result
string result_kind
string unmet_json
string message
string inputs_json
string outputs_json
string resource
string from_state
string to_state
string cause
string reason
"""
"""The definition of version 0.3.0, whose header carries the instance id."""
OF_0_2 = re.sub("string (unmet_json|reason|result_kind)\n", "", OF_0_3)


def bag(path, events, storage, definition=DEFINITION):
    """Write what a recorder of ROS 2 would: CDR on a topic of each skillset."""
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(definition, MESSAGE))
    message, header, time = (store.types[name] for name in (MESSAGE, "std_msgs/msg/Header", "builtin_interfaces/msg/Time"))
    with BagWriter(path, version=9, storage_plugin=storage) as writer:
        topics = {}
        for event in events:
            topic = topics.setdefault(event.skillset, None) or writer.add_connection(f"/{event.skillset}/events", MESSAGE, typestore=store)
            topics[event.skillset] = topic
            told = event_record(event)
            fields = {
                name: told.get(name, "") for name in ("skillset", "skill", "id", "state", "result", "result_kind", "message", "resource")
            }
            fields |= {name: told.get(name, "") for name in ("from_state", "to_state", "cause", "reason", "instance_id")}
            fields |= {"unmet_json": json.dumps(told["unmet"]) if told.get("unmet") else ""}
            stamp = time(sec=event.stamp_ns // 10**9, nanosec=event.stamp_ns % 10**9)
            frame_id = "" if "instance_id" in definition else event.instance_id
            whole = message(
                header=header(stamp=stamp, frame_id=frame_id),
                sequence=event.sequence,
                kind=int(told["kind"] == "TRANSITION"),
                inputs_json=json.dumps(told.get("inputs", {})),
                outputs_json="",
                EXECUTION=0,
                TRANSITION=1,
                **{name: value for name, value in fields.items() if f"string {name}" in definition},
            )
            writer.write(topic, event.stamp_ns, store.serialize_cdr(whole, MESSAGE))


def test_every_kind_of_log_says_the_same(tmp_path, flown, capsys):
    record(tmp_path / FILE, flown)
    lines(tmp_path / "events.jsonl", flown)
    bag(tmp_path / "mcap", flown, StoragePlugin.MCAP)
    bag(tmp_path / "sqlite", flown, StoragePlugin.SQLITE3)
    assert [event_record(event) for event in read_log(tmp_path).events] == [event_record(event) for event in flown]
    inside = next((tmp_path / "mcap").glob("*.mcap"))
    for log in (tmp_path, tmp_path / FILE, tmp_path / "events.jsonl", tmp_path / "mcap", tmp_path / "sqlite", inside):
        assert main([str(log), "--json"]) == 0
        verdict = json.loads(capsys.readouterr().out)
        assert (verdict["conforms"], verdict["events"], verdict["cut"]) == (True, len(flown), "")


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
@pytest.mark.parametrize("definition", [OF_0_2, OF_0_3, DEFINITION])
def test_bags_of_every_version_say_whose_each_event_is(tmp_path, flown, storage, definition, capsys):
    bag(tmp_path / "bag", flown, storage, definition)
    told = read_log(tmp_path / "bag").events
    assert [(one.instance_id, one.sequence) for one in told] == [(one.instance_id, one.sequence) for one in flown]
    assert len({one.instance_id for one in told}) == len({one.skillset for one in told}), "each skillset has managers of its own"
    assert main([str(tmp_path / "bag"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["restarts"] == {}


@pytest.mark.parametrize("name", ["mapping", "mapping-zed", "mapping-both", "inspection", "inspection-radio"])
def test_flights_of_the_whole_stack_conform(name, capsys):
    assert main([str(ROOT / "tests" / "recordings" / name)]) == 0
    assert ": conforms: " in capsys.readouterr().out


def test_a_log_that_is_older_than_its_model_conforms_with_what_no_event_is_about_and_that_is_told(capsys):
    recording = ROOT / "tests" / "recordings" / "mapping"
    assert main([str(recording), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["assumed"] == ["navigation.link == UP"]
    assert main([str(recording)]) == 0
    assert "navigation.link == UP from the beginning on" in capsys.readouterr().out


def test_a_run_that_never_started_has_no_events_and_that_is_what_is_told(tmp_path, capsys):
    writer = RecordWriter(tmp_path / FILE)
    writer.write(MISSION, 0, {"scenario": "inspection"})
    writer.close()
    assert main([str(tmp_path)]) == 2
    assert capsys.readouterr().err == f"alula conform: {tmp_path / FILE}: has no events of skillsets\n"


def test_what_does_not_conform_is_told_and_ends_with_1(tmp_path, flown, capsys):
    at = next(number for number, event in enumerate(flown) if getattr(event, "resource", "") == "axes_authority")
    lines(tmp_path / "events.jsonl", [*flown[:at], *flown[at + 1 :]])
    assert main([str(tmp_path)]) == 1
    said = capsys.readouterr().out
    assert said.startswith(f"{tmp_path / 'events.jsonl'}: does not conform\n  navigation event ")
    assert f"event {flown[at].sequence} is missing" in said
    assert "the models allow instead: axes_authority AVAILABLE -> USED (takeoff " in said


def test_another_model_may_be_given(tmp_path, flown, capsys):
    lines(tmp_path / "events.jsonl", flown)
    text = (ROOT / "skillsets/uav/perception.skill").read_text(encoding="utf-8")
    other = tmp_path / "other.skill"
    other.write_text(text.replace("zed_status == OK", "zed_status != UNKNOWN"), encoding="utf-8")
    assert other.read_text(encoding="utf-8") != text
    assert main([str(tmp_path), "--model", str(other)]) == 1
    assert "zed_depthmap" in capsys.readouterr().out


def test_a_log_that_was_cut_off_is_read_up_to_there(tmp_path, flown, capsys):
    record(tmp_path / FILE, flown)
    whole = (tmp_path / FILE).read_bytes()
    (tmp_path / FILE).write_bytes(whole[: len(whole) // 2])
    assert main([str(tmp_path)]) == 0
    assert "read up to the damage: it was cut off" in capsys.readouterr().out
    lines(tmp_path / "cut.jsonl", flown)
    (tmp_path / "cut.jsonl").write_bytes((tmp_path / "cut.jsonl").read_bytes()[:-20])
    assert main([str(tmp_path / "cut.jsonl")]) == 0
    assert "its last line was cut off" in capsys.readouterr().out


def test_where_a_complete_log_is_asked_for_a_hole_is_named_and_ends_with_1(tmp_path, flown, capsys):
    lines(tmp_path / "whole.jsonl", flown)
    assert main([str(tmp_path / "whole.jsonl"), "--complete"]) == 0
    assert capsys.readouterr().err == ""
    (tmp_path / "cut.jsonl").write_bytes((tmp_path / "whole.jsonl").read_bytes()[:-20])
    assert main([str(tmp_path / "cut.jsonl"), "--complete", "--json"]) == 1
    told = capsys.readouterr()
    assert json.loads(told.out)["conforms"] is True
    breaks_off = f"alula conform: {tmp_path / 'cut.jsonl'}: is not complete: it breaks off: its last line was cut off"
    assert told.err.startswith(breaks_off)
    record(tmp_path / FILE, flown)
    whole = bytearray((tmp_path / FILE).read_bytes())
    whole[len(whole) // 2 :] = b"\xff" * (len(whole) - len(whole) // 2)
    (tmp_path / FILE).write_bytes(whole)
    assert main([str(tmp_path), "--complete"]) == 1
    assert "is not complete: it breaks off: damaged " in capsys.readouterr().err
    within = next(number for number, event in enumerate(flown) if getattr(event, "resource", "") == "axes_authority")
    lines(tmp_path / "within.jsonl", flown[: within + 1])
    assert main([str(tmp_path / "within.jsonl")]) == 0
    assert main([str(tmp_path / "within.jsonl"), "--complete"]) == 1
    assert capsys.readouterr().err.endswith(" should follow\n")


def foreign_mcap(path):
    writer = Writer(str(path))
    writer.start()
    channel = writer.register_channel("/other", "json", writer.register_schema("x", "jsonschema", b"{}"))
    writer.add_message(channel, 0, b"{}", 0)
    writer.finish()


UNREADABLE = {
    "no such": ("nothing.mcap", lambda _: None, "there is no such file or folder"),
    "a folder": ("empty", lambda path: path.mkdir(), "is no run and no bag"),
    "a suffix": ("log.txt", lambda path: path.write_text("x"), "is no log"),
    "no magic": ("x.mcap", lambda path: path.write_text("x" * 100), "is no MCAP file"),
    "foreign": ("x.mcap", foreign_mcap, "can't be read as a bag"),
    "empty": ("x.jsonl", lambda path: path.write_text(""), "has no events of skillsets"),
    "no json": ("x.jsonl", lambda path: path.write_text("{\n{}\n"), "x.jsonl:1: is no JSON"),
    "no event": ("x.jsonl", lambda path: path.write_text('{"kind": "NOD"}\n'), "x.jsonl:1: is no event: there is no kind of event 'NOD'"),
    "a list": ("x.jsonl", lambda path: path.write_text("[1]\n"), "x.jsonl:1: is no event, but list"),
    "a bag": ("x.bag", lambda path: path.write_bytes(os.urandom(64)), "can't be read as a bag"),
    "a database": ("x.db3", lambda path: path.write_bytes(os.urandom(64)), "can't be read as a bag"),
    "no model": (
        "x.jsonl",
        lambda path: path.write_text(
            '{"kind": "TRANSITION", "stamp_s": 0, "skillset": "os; x", "resource": "r", "from_state": "", "to_state": ""}\n'
        ),
        "there is no model of skillset 'os; x' in this robot; give its file with --model",
    ),
    "a slip": (
        "x.jsonl",
        lambda path: path.write_text(
            '{"kind": "TRANSITION", "stamp_s": 0, "skillset": "navigaton", "resource": "r", "from_state": "", "to_state": ""}\n'
        ),
        "there is no model of skillset 'navigaton' in this robot; give its file with --model; did you mean `navigation`?",
    ),
}


@pytest.mark.parametrize("what", UNREADABLE)
def test_what_can_not_be_read_is_refused_in_one_line(what, tmp_path, capsys):
    name, make, complaint = UNREADABLE[what]
    make(tmp_path / name)
    assert main([str(tmp_path / name)]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("alula conform: ")
    assert printed.err.count("\n") == 1
    assert complaint in printed.err


def foreign(path, storage, *topics):
    """Write a bag of somebody else: strings on each topic."""
    store = get_typestore(Stores.ROS2_JAZZY)
    kind = "std_msgs/msg/String"
    with BagWriter(path, version=9, storage_plugin=storage) as writer:
        for topic in topics:
            writer.write(writer.add_connection(topic, kind, typestore=store), 1, store.serialize_cdr(store.types[kind](data="a"), kind))


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_bag_of_somebody_else_has_no_events_and_what_it_has_is_told(tmp_path, storage, capsys):
    foreign(tmp_path / "bag", storage, "/chatter", "/other")
    inside = next(path for path in (tmp_path / "bag").iterdir() if path.suffix != ".yaml")
    for path in (tmp_path / "bag", inside):
        assert main([str(path)]) == 2
        told = f"{path}: has no events of skillsets: no topic of {MESSAGE}; it has topics of std_msgs/msg/String"
        assert capsys.readouterr().err == f"alula conform: {told}\n"


def test_a_bag_of_ros_1_of_somebody_else_has_no_events(tmp_path, capsys):
    store = get_typestore(Stores.ROS1_NOETIC)
    kind = "std_msgs/msg/String"
    with Ros1Writer(tmp_path / "their.bag") as writer:
        writer.write(writer.add_connection("/chatter", kind, typestore=store), 1, store.serialize_ros1(store.types[kind](data="a"), kind))
    assert main([str(tmp_path / "their.bag")]) == 2
    assert capsys.readouterr().err.endswith(f"no topic of {MESSAGE}; it has topics of std_msgs/msg/String\n")


def changed(path, statement):
    with contextlib.closing(sqlite3.connect(next(path.glob("*.db3")))) as connection:
        connection.execute(statement)
        connection.commit()


def test_a_definition_of_others_that_makes_no_sense_keeps_no_event_from_being_read(tmp_path, flown, capsys):
    bag(tmp_path / "bag", flown, StoragePlugin.MCAP)
    inside = next((tmp_path / "bag").glob("*.mcap"))
    with inside.open("rb") as file, (tmp_path / "more.mcap").open("wb") as more:
        writer = Writer(more)
        writer.start(profile="ros2")
        schema = writer.register_schema("std_srvs/srv/SetBool_Event", "ros2msg", b"service_msgs/ServiceEventInfo info\nnothing[<=] of.this")
        other = writer.register_channel("/x/_service_event", "cdr", schema)
        writer.add_message(other, 1, b"\0\1\0\0", 1)
        topics = {}
        for schema, channel, message in make_reader(file).iter_messages():
            if channel.topic not in topics:
                topics[channel.topic] = writer.register_channel(
                    channel.topic, "cdr", writer.register_schema(schema.name, schema.encoding, schema.data), channel.metadata
                )
            writer.add_message(topics[channel.topic], message.log_time, message.data, message.publish_time)
        writer.finish()
    assert main([str(tmp_path / "more.mcap"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["events"] == len(flown)


def test_events_without_their_definition_are_named_with_the_remedy(tmp_path, flown, capsys):
    bag(tmp_path / "bag", flown, StoragePlugin.SQLITE3)
    changed(tmp_path / "bag", "delete from message_definitions")
    assert main([str(tmp_path / "bag")]) == 2
    told = capsys.readouterr().err
    assert f"{tmp_path / 'bag'}: has events of skillsets on /" in told
    assert f"but no definition of {MESSAGE}; give the bag one where that message is installed: ros2 bag convert" in told
