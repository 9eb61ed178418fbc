"""The bag of a flight's functional layer: its messages, and the calls of services that it tells of."""

from __future__ import annotations

import heapq
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rosbags.highlevel import AnyReader
from rosbags.interfaces import ConnectionExtRosbag1
from rosbags.typesys import Stores, get_typestore

from alula.common.record import OPERATOR, TICKS, Entry
from alula.records.replay.recorded import Recorded, ReplayError

MOST_SAID = 200
"""Characters of what a reader says of a damaged bag: it can quote the definition of a message."""
CALLS = "/calls"
MESSAGE = "message"


@dataclass(frozen=True)
class Call:
    """A call of a service; ``response`` None: there was none. Seconds of mission clock."""

    service: str
    request: Mapping[str, Any]
    response: Mapping[str, Any] | None
    end_s: float


def read_bag(path: Path, topics: Iterable[str]) -> Iterator[Entry]:
    """Yield messages of a ROS 1 bag in the order in which they were recorded, ``{"message": object with the fields}``.

    Raises:
        ReplayError: it is no bag, or damaged.
    """
    wanted = set(topics)
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS1_NOETIC)) as reader:
            found = [c for c in reader.connections if c.topic in wanted and isinstance(c.ext, ConnectionExtRosbag1)]
            # No connections would mean all of them.
            for connection, stamp_ns, raw in reader.messages(connections=found) if found else ():
                yield Entry(connection.topic, stamp_ns, {MESSAGE: reader.deserialize(raw, connection.msgtype)})
    except Exception as error:  # whatever a damaged or hostile bag makes the reader raise
        said = " ".join(str(error).split())[:MOST_SAID] or type(error).__name__
        raise ReplayError(f"{path}: can't be read as a bag: {said}") from error


def read_calls(path: Path) -> list[Call]:
    """Return the calls of services that a bag tells of; raises ReplayError where it tells of none, as older ones do not."""
    calls = []
    try:
        for entry in read_bag(path, [CALLS]):
            value = json.loads(entry.value[MESSAGE].data)
            calls.append(Call(str(value["service"]), dict(value["request"]), value["response"], float(value["end_s"])))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ReplayError(f"{path}: holds what is no call of a service on {CALLS}: {type(error).__name__} {error}") from error
    if not calls:
        raise ReplayError(f"{path}: holds no calls of services ({CALLS}), so the answers of the functional layer are missing")
    return calls


def begin_of(recorded: Recorded, bag: Path) -> float:
    """Return when the first of both begins, seconds of mission clock."""
    first = next(read_bag(bag, [CALLS]), None)
    stamps = [entry.stamp_ns for entry in (*recorded.entries[:1], first) if entry is not None]
    return min(stamps, default=0) / 1e9


def entries_of(recorded: Recorded, bag: Path, topics: Iterable[str]) -> Iterator[Entry]:
    """Yield the bag's messages, and when the tree was ticked and told to stop, in the order of time."""
    asked = (entry for entry in recorded.entries if entry.topic in {TICKS, OPERATOR})
    return heapq.merge(read_bag(bag, topics), asked, key=lambda entry: entry.stamp_ns)
