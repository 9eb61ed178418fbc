"""Nodes of the rover's own in files of missions: what is next of its parcels, ways, doors and places."""

from __future__ import annotations

from typing import Any, ClassVar

from alula import parts
from alula.trees import ANY, FAILURE, INT, STRING, SUCCESS, Answer, Port, SyncAction, TickError, input_port, output_port, register

COUNT = input_port("done", INT, doc="how many of them are behind")
MANY = output_port("count", INT, doc="how many there are")


class Next(SyncAction):
    """Writes the next one of a list; fails when there are no more. It is the same one until ``done`` has grown."""

    def listed(self) -> list[Any]:
        """Return the list."""
        raise NotImplementedError

    def write(self, entry: Any) -> str:
        """Write what is next; return what to tell of it."""
        raise NotImplementedError

    def update(self) -> Answer:
        """Write it."""
        entries, done = self.listed(), self.number("done")
        if not isinstance(entries, list):
            raise TickError(f"{self.place()}: that is no list")
        if "count" in self.ports_by_name():
            self.put("count", len(entries))
        if done >= len(entries):
            self.feedback_message = "no more"
            return FAILURE
        self.feedback_message = f"{done + 1} of {len(entries)}: {self.write(entries[done])}"
        return SUCCESS

    def ports_by_name(self) -> set[str]:
        """Return the names of its ports."""
        return {port.name for port in self.ports}


@register("rover.NextParcel")
class NextParcel(Next):
    """The parcel that is next, and the rooms at its two ends."""

    ports: ClassVar[tuple[Port, ...]] = (
        input_port("parcels", ANY),
        COUNT,
        MANY,
        output_port("parcel", STRING),
        output_port("from", ANY, doc="a room"),
        output_port("sender", STRING, doc="its name"),
        output_port("to", ANY, doc="a room"),
        output_port("receiver", STRING, doc="its name"),
    )

    def listed(self) -> list[Any]:
        """Return the parcels."""
        parcels: list[Any] = self.get("parcels")  # type: ignore[assignment]
        return parcels

    def write(self, entry: Any) -> str:
        """Write it."""
        self.put("parcel", entry["name"])
        for room, name in (("from", "sender"), ("to", "receiver")):
            self.put(room, entry[room])
            self.put(name, entry[room]["name"])
        return str(entry["name"])


@register("rover.NextWay")
class NextWay(Next):
    """A way into a room that was not tried yet: its doors; and the place in the room."""

    ports: ClassVar[tuple[Port, ...]] = (
        input_port("room", ANY),
        COUNT,
        output_port("way", ANY, doc="doors"),
        output_port("inside", ANY, unit="m"),
    )

    def listed(self) -> list[Any]:
        """Return the ways."""
        room: Any = self.get("room")
        ways: list[Any] = room["ways"]
        return ways

    def write(self, entry: Any) -> str:
        """Write it."""
        room: Any = self.get("room")
        self.put("way", entry)
        self.put("inside", room["inside"])
        return f"{room['name']} by {' and '.join(door['door'] for door in entry)}"


@register("rover.NextDoor")
class NextDoor(Next):
    """The next door on a way: where the rover stands before it, and the safe place near it."""

    ports: ClassVar[tuple[Port, ...]] = (
        input_port("way", ANY),
        COUNT,
        MANY,
        output_port("door", STRING),
        output_port("at", ANY, unit="m"),
        output_port("safe", ANY, unit="m"),
    )

    def listed(self) -> list[Any]:
        """Return the doors."""
        way: list[Any] = self.get("way")  # type: ignore[assignment]
        return way

    def write(self, entry: Any) -> str:
        """Write it."""
        for name in ("door", "at", "safe"):
            self.put(name, entry[name])
        return str(entry["door"])


@register("rover.NextPlace")
class NextPlace(Next):
    """The next place of a round."""

    ports: ClassVar[tuple[Port, ...]] = (input_port("places", ANY), COUNT, MANY, output_port("place", ANY, unit="m"))

    def listed(self) -> list[Any]:
        """Return the places."""
        places: list[Any] = self.get("places")  # type: ignore[assignment]
        return places

    def write(self, entry: Any) -> str:
        """Write it."""
        self.put("place", entry)
        return f"({entry['x']:g}, {entry['y']:g})"


PART = parts.MissionPart((NextParcel, NextWay, NextDoor, NextPlace))
