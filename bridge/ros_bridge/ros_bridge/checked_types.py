"""What discovery asks about types: which is which in the other world, and whether they can cross; each answer is found once and kept.

A node in ROS 1 may have another version of a type than the files here. It is asked for its definition where the type is not known, and
when a connection to it was refused: asking takes a connection, which a publisher takes for a subscriber. So clients of actions, who wait
for one, are asked only then. A subscriber is never asked: it says its definition when it connects.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ros_bridge import ros1_definition
from ros_bridge.action_types import action_type
from ros_bridge.errors import BridgeError, TypeDiffersError, TypeUnknownError
from ros_bridge.ros1_definition import require_type_name
from ros_bridge.ros2_types import interface_class

if TYPE_CHECKING:
    from ros_bridge.conversion import Types
    from ros_bridge.graph import Ros1Graph

Headers = Callable[[str], Iterable[Mapping[str, str]]]
SUM = re.compile(r"[0-9a-f]{32}")
ASK_AGAIN_S = 10.0
FROM_SERVER, FROM_CLIENT = ("feedback", "result"), "goal"


@dataclass(frozen=True)
class CheckedPair:
    """A type of ROS 1 and one of ROS 2 that can cross.

    ``md5sum``: of the definition that ROS 1's node has, where it was asked. ``notes``: fields that have another name in the other world, or
    no counterpart. ``bulky``: whether messages can be large.
    """

    ros1_type: str
    ros2_type: str
    md5sum: str = ""
    notes: tuple[str, ...] = ()
    bulky: bool = False


@dataclass(frozen=True)
class _Answer:
    """What the publishers of a topic have said about their type, or where there are none, a subscriber (``teacher``)."""

    publishers: frozenset[str]
    asked_s: float
    md5sum: str = ""
    problem: str = ""
    teacher: str = ""


NOTHING = _Answer(frozenset(), 0.0)


class CheckedTypes:
    """The types that cross, each pair checked once; what ``decisions.decide`` asks of types."""

    def __init__(self, types: Types, headers: Headers, service_sums: Mapping[str, str] | None = None) -> None:
        """``headers`` asks the ROS 1 publishers of a topic for their connection headers; it may take a second each.

        ``service_sums`` has the MD5 sums of ROS 1's services by their names, as their nodes have told them.
        """
        self._types = types
        self._headers = headers
        self._service_sums = service_sums if service_sums is not None else {}
        self._kept: dict[tuple[str, str, str, str], CheckedPair | BridgeError] = {}
        self._answers: dict[str, _Answer] = {}
        self._publishers: Mapping[str, frozenset[str]] = {}
        self._refused: set[str] = set()
        self._heard: dict[str, Mapping[str, str]] = {}

    def look_at(self, graph: Ros1Graph) -> None:
        """Take ROS 1's graph: what nodes have said that are gone does not count any more."""
        self._publishers = graph.publishers
        self._answers = {
            topic: answer
            for topic, answer in self._answers.items()
            if graph.publishers.get(topic, frozenset()) == answer.publishers and (answer.publishers or topic in graph.subscribers)
        }

    def doubt(self, topic: str) -> None:
        """Note that a publisher in ROS 1 was refused because of its type: it is asked at the next look. From any thread."""
        self._refused.add(topic)

    def has_version_of(self, header: Mapping[str, str]) -> bool:
        """Return whether the topic of a subscriber's header crosses with the definition that the subscriber has."""
        answer = self._answers.get(header.get("topic", ""), NOTHING)
        return answer.md5sum == header.get("md5sum")

    def hear(self, header: Mapping[str, str]) -> None:
        """Take the connection header of a subscriber in ROS 1 that was turned away because of its type. From any thread."""
        self._heard[header.get("topic", "")] = header
        self.doubt(header.get("topic", ""))

    def pair(self, ros1_type: str | None, ros2_type: str | None, topic: str) -> CheckedPair:
        """Complete a pair of which one may be unknown, and check that its messages can cross; raises BridgeError."""
        ros1_type, ros2_type = self._complete(ros1_type, ros2_type)
        answer = self._ask(topic, ros1_type)

        def check() -> CheckedPair:
            pair = self._types.message(ros1_type, ros2_type, answer.md5sum)
            interface_class(ros2_type, "msg")
            return CheckedPair(ros1_type, ros2_type, answer.md5sum, pair.notes, self._types.bulky(ros2_type))

        try:
            return self._check("msg", ros1_type, ros2_type, answer.md5sum, check)
        except TypeUnknownError as error:
            if answer.problem and not self._types.knows_ros1(ros1_type):
                raise TypeUnknownError(f"its publisher's definition of {ros1_type}: {answer.problem}") from error
            raise

    def service(self, ros1_type: str | None, ros2_type: str | None, service: str) -> CheckedPair:
        """Do the same for a service; where ROS 1 has the server, by its name."""
        ros1_type, ros2_type = self._complete(ros1_type, ros2_type)
        said = self._service_sums.get(service, "")
        md5sum = said if SUM.fullmatch(said) else ""

        def check() -> CheckedPair:
            found = self._types.service(ros1_type, ros2_type, md5sum)
            interface_class(ros2_type, "srv")
            return CheckedPair(ros1_type, ros2_type, md5sum, (*found.request.notes, *found.response.notes))

        return self._check("srv", ros1_type, ros2_type, md5sum, check)

    def action(self, ros1_type: str | None, ros2_type: str | None, action: str) -> CheckedPair:
        """Do the same for an action; the nodes of its topics in ROS 1 are asked as publishers are."""
        ros1_type, ros2_type = self._complete(ros1_type, ros2_type)
        answers = []
        for part in (*FROM_SERVER, FROM_CLIENT):
            header_type, known_by = f"{ros1_type}Action{part.capitalize()}", f"{ros1_type}{part.capitalize()}"
            if part in FROM_SERVER or f"{action}/{part}" in self._refused:
                self._ask(f"{action}/{part}", header_type, known_by)
            answers.append(self._answers.get(f"{action}/{part}", NOTHING))
        said = " ".join(answer.md5sum for answer in answers)

        def check() -> CheckedPair:
            found = action_type(self._types, ros1_type, ros2_type)
            interface_class(ros2_type, "action")
            md5sum = ros1_definition.md5("".join(part.envelope.md5sum for part in found.parts))
            return CheckedPair(ros1_type, ros2_type, md5sum, tuple(note for part in found.parts for note in part.pair.notes))

        return self._check("action", ros1_type, ros2_type, said, check)

    def _complete(self, ros1_type: str | None, ros2_type: str | None) -> tuple[str, str]:
        rules = self._types.rules
        for name in (ros1_type, ros2_type):
            if name is not None:
                require_type_name(name)
        if ros1_type is None and ros2_type is None:
            raise TypeUnknownError("its node does not say its type")
        one = ros1_type if ros1_type is not None else rules.to_ros1(str(ros2_type))
        two = ros2_type if ros2_type is not None else rules.to_ros2(one)
        if not rules.related(one, two):
            raise TypeDiffersError(
                f"it is {one} in ROS 1 and {two} in ROS 2; if these are one type, say so in the configuration's 'types' "
                f"({{ros1: {one}, ros2: {two}}})",
            )
        return one, two

    def _ask(self, topic: str, header_type: str, known_by: str = "") -> _Answer:
        """Return what the nodes of a topic say about their type; publishers are asked where it is not known or a connection was refused.

        ``known_by`` is the type that has to be known, where it is not the header's own.
        """
        publishers = self._publishers.get(topic, frozenset())
        kept = self._answers.get(topic)
        now_s = time.monotonic()
        refused = topic in self._refused
        self._refused.discard(topic)
        if kept is None:
            wanted = refused or (bool(publishers) and not self._types.knows_ros1(known_by or header_type))
        else:
            wanted = refused or (bool(kept.problem) and now_s - kept.asked_s > ASK_AGAIN_S)
        if wanted:
            self._answers[topic] = self._read_headers(topic, header_type, kept, _Answer(publishers, now_s))
            self._kept = {key: found for key, found in self._kept.items() if isinstance(found, CheckedPair) and key[0] != "action"}
        return self._answers.get(topic, NOTHING)

    def _read_headers(self, topic: str, header_type: str, kept: _Answer | None, empty: _Answer) -> _Answer:
        sums, problem, teacher = [], "", ""
        heard = self._heard.pop(topic, None)
        for header in [*self._headers(topic), *([heard] if heard is not None else [])]:
            if header.get("type") != header_type or SUM.fullmatch(header.get("md5sum", "")) is None:
                continue
            sums.append(header["md5sum"])
            try:
                self._types.learn(header_type, header.get("message_definition", ""), header["md5sum"])
            except BridgeError as error:
                problem = str(error)
        if heard is not None and len(sums) == 1:
            teacher = heard.get("callerid", "")
        if kept is not None and (kept.md5sum in sums or (teacher and kept.md5sum and not kept.problem and teacher != kept.teacher)):
            return kept  # it is another node that was refused, and those that the route has suit each other
        return _Answer(empty.publishers, empty.asked_s, sums[0] if sums else "", problem or ("" if sums else "it says none"), teacher)

    def _check(self, kind: str, ros1_type: str, ros2_type: str, md5sum: str, check: Callable[[], CheckedPair]) -> CheckedPair:
        key = (kind, ros1_type, ros2_type, md5sum)
        if key not in self._kept:
            try:
                self._kept[key] = check()
            except BridgeError as error:
                self._kept[key] = error
            except Exception as error:  # noqa: BLE001 - what a definition or a package can make a parser raise refuses this type alone
                self._kept[key] = TypeUnknownError(f"{ros1_type} can't be read: {type(error).__name__}: {error}")
        if isinstance(found := self._kept[key], BridgeError):
            raise type(found)(str(found))  # raised often, and each time the error would grow by a traceback
        return found
