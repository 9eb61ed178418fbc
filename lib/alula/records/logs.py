"""Reads the events of skillsets from whatever they were logged in: a run, a record, a bag of either ROS world, JSON lines."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from alula.common.record import EVENTS, FILE, MISSION, RecordError, RecordFollower
from alula.records.errors import AnalysisError
from alula.runtime.core.events import EXECUTION, TRANSITION, EngineEvent, read_event

if TYPE_CHECKING:
    from rosbags.interfaces import Connection

LINES = "events.jsonl"
MESSAGE = "skillset_interfaces/msg/Event"
_KINDS = {0: EXECUTION, 1: TRANSITION}
_SUFFIXES = (".mcap", ".db3", ".bag", ".jsonl", ".json")


@dataclass(frozen=True)
class Log:
    """The events of a log in their order; ``cut`` says why it breaks off, where it does."""

    path: Path
    events: tuple[EngineEvent, ...]
    cut: str = ""

    @property
    def skillsets(self) -> tuple[str, ...]:
        """The skillsets that it is about."""
        return tuple(dict.fromkeys(event.skillset for event in self.events))


def read_log(path: Path) -> Log:
    """Return a log.

    Args:
        path: a run's folder, ``skills.mcap``, a rosbag2 folder or file or a ROS 1 bag with Event messages, or ``events.jsonl``.

    Raises:
        AnalysisError: there is nothing of the kind, it can't be read, or has no events.
    """
    file = _log_file(path)
    if file.suffix in {".jsonl", ".json"}:
        log = _read_lines(file)
    elif file.suffix == ".mcap" and (record := _read_record(file)) is not None:
        log = record
    else:
        log = _read_bag(file)
    if not log.events:
        raise AnalysisError(f"{file}: has no events of skillsets{f'; {log.cut}' if log.cut else ''}")
    return log


def _log_file(path: Path) -> Path:
    if not path.exists():
        raise AnalysisError(f"{path}: there is no such file or folder")
    if not path.is_dir():
        if path.suffix not in _SUFFIXES:
            raise AnalysisError(f"{path}: is no log; it should be a folder or one of *{', *'.join(_SUFFIXES)}")
        return path
    if (path / "metadata.yaml").is_file():
        return path
    found = [path / name for name in (FILE, LINES) if (path / name).is_file()]
    if not found:
        raise AnalysisError(f"{path}: is no run and no bag: it has no {FILE}, {LINES} or metadata.yaml")
    return found[0]


def _event(value: dict[str, Any], place: str) -> EngineEvent:
    try:
        return read_event(value)
    except ValueError as error:
        raise AnalysisError(f"{place}: is no event: {error}") from None


def _read_record(path: Path) -> Log | None:
    """Return the log of a record, empty where no skill was ever started; None where the file is an MCAP of something else."""
    follower = RecordFollower(path)
    try:
        entries = follower.poll()
    except (RecordError, OSError) as error:
        raise AnalysisError(str(error)) from None
    told = [entry for entry in entries if entry.topic == EVENTS]
    if follower.ended and not any(entry.topic in {EVENTS, MISSION} for entry in entries):
        return None
    return Log(path, tuple(_event(dict(entry.value), f"{path}: message at {entry.stamp_s:.3f} s") for entry in told), follower.cut)


def _read_lines(path: Path) -> Log:
    try:
        lines = path.read_text(encoding="utf-8").split("\n")
    except (OSError, UnicodeDecodeError) as error:
        raise AnalysisError(f"{path}: can't be read: {error}") from None
    events: list[EngineEvent] = []
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        try:
            value = json.loads(line)
        except (ValueError, RecursionError) as error:
            if number == len(lines):  # a writer ends each line: what stands behind the last one was cut off
                return Log(path, tuple(events), "its last line was cut off")
            raise AnalysisError(f"{path}:{number}: is no JSON: {error}") from None
        if not isinstance(value, dict):
            raise AnalysisError(f"{path}:{number}: is no event, but {type(value).__name__}")
        events.append(_event(value, f"{path}:{number}"))
    return Log(path, tuple(events))


def _read_bag(path: Path) -> Log:
    """Return the log of a bag. Only the definition of our own message is asked of it: what else was recorded may lack or break its own."""
    from rosbags import rosbag1, rosbag2  # late: it takes a moment, and most logs are records

    try:
        with rosbag1.Reader(path) if path.suffix == ".bag" else rosbag2.Reader(path) as reader:
            wanted = [one for one in reader.connections if one.msgtype == MESSAGE]
            read = _decoder(path, reader.connections, ros1=path.suffix == ".bag")
            events = tuple(_from_message(read(data), path) for _, _, data in reader.messages(wanted))
    except AnalysisError:
        raise
    except Exception as error:  # noqa: BLE001 - whatever a damaged or hostile bag makes the reader raise
        remedy = "" if path.suffix == ".bag" else f"; if it is whole, copy its topics of {MESSAGE} into another (ros2 bag convert)"
        raise AnalysisError(f"{path}: can't be read as a bag: {type(error).__name__}: {error}{remedy}") from None
    return Log(path, events)


def _decoder(path: Path, connections: Sequence[Connection], *, ros1: bool) -> Callable[[bytes], Any]:
    """Return what reads a message of a bag, by the definition that the bag has of it: other versions have other fields."""
    from rosbags.interfaces import MessageDefinitionFormat
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    connection = next((one for one in connections if one.msgtype == MESSAGE), None)
    if connection is None:
        types = sorted({one.msgtype for one in connections})
        there = f"topics of {', '.join(types[:3])}{', ...' if len(types) > 3 else ''}" if types else "no topics"
        raise AnalysisError(f"{path}: has no events of skillsets: no topic of {MESSAGE}; it has {there}")
    if connection.msgdef.format is not MessageDefinitionFormat.MSG:
        raise AnalysisError(
            f"{path}: has events of skillsets on {connection.topic}, but no definition of {MESSAGE}; give the bag one where that message"
            " is installed: ros2 bag convert, to storage mcap"
        )
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(connection.msgdef.data, MESSAGE))
    read = store.deserialize_ros1 if ros1 else store.deserialize_cdr
    return lambda data: read(data, MESSAGE)


def _from_message(message: Any, path: Path) -> EngineEvent:
    """Return the event of a message of any version: older ones have no reason and no kind of result, and the instance id in the header."""
    stamp_s = message.header.stamp.sec + message.header.stamp.nanosec / 1e9
    names = ("sequence", "skillset", "skill", "id", "state", "result", "message", "resource", "from_state", "to_state", "cause")
    value = {"stamp_s": stamp_s, "kind": _KINDS.get(message.kind), **{name: getattr(message, name) for name in names}}
    value |= {name: getattr(message, name, "") for name in ("result_kind", "reason")} | dict(_values(message, path))
    value["instance_id"] = getattr(message, "instance_id", message.header.frame_id)
    return _event(value, str(path))


def _values(message: Any, path: Path) -> Iterator[tuple[str, object]]:
    for name in ("inputs", "outputs", "unmet"):
        text = getattr(message, f"{name}_json", "")  # older bags do not say what was unmet
        try:
            yield name, json.loads(text) if text else {}
        except (ValueError, RecursionError) as error:
            raise AnalysisError(f"{path}: event {message.sequence} of {message.skillset} has no JSON in {name}_json: {error}") from None
