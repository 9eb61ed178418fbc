"""What the kernel is told to be the radio: network namespaces and queues, as commands of ``ip`` and ``tc``. Pure.

Three namespaces in a row, drone, air and ground, joined by veth pairs. What leaves the drone passes a token bucket (tbf) there, then
delay, jitter and loss (netem) in the air; what leaves the ground, alike. Addresses are their own: nothing of it reaches another network.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from radio_link.channel import BURST_BYTES, Condition

Command = tuple[str, ...]

DRONE, AIR, GROUND = "drone", "air", "ground"
ENDS = (DRONE, GROUND)
AIR_PACKETS = 10_000  # that netem may hold; the queue of the radio is the token bucket's
LEAST_RATE_BPS = 1_000  # tbf has no rate of nothing; what is out is lost in the air
IN_ORDER = "1gbit"  # netem with a rate of its own lets no packet overtake another, whatever the jitter


class Direction(Enum):
    """Down: from the drone to the ground."""

    DOWN = "down"
    UP = "up"

    @property
    def sender(self) -> str:
        """The end that sends."""
        return DRONE if self is Direction.DOWN else GROUND

    @property
    def receiver(self) -> str:
        """The end that receives."""
        return GROUND if self is Direction.DOWN else DRONE


@dataclass(frozen=True)
class Radio:
    """The names of one emulated radio; ``number`` tells it from those of other runs on the machine."""

    number: int

    def namespace(self, part: str) -> str:
        """Return the name of the namespace of drone, air or ground."""
        return f"alula-{self.number}-{part}"

    @staticmethod
    def address(end: str) -> str:
        """Return the IPv4 address of an end."""
        return f"10.77.{1 + ENDS.index(end)}.1"


def set_up(radio: Radio) -> list[Command]:
    """Return what makes the namespaces, with good roads and no queues yet."""
    commands: list[Command] = [("ip", "netns", "add", radio.namespace(part)) for part in (DRONE, AIR, GROUND)]
    # IPv6 announces itself now and then; that would take of the radio's rate.
    commands += [_write(radio, part, "ipv6/conf/all/disable_ipv6", "1", optional=True) for part in (DRONE, AIR, GROUND)]
    for end in ENDS:
        commands += _link(radio, end)
    commands += [_ip(radio, end, "route", "add", "10.77.0.0/16", "via", _gateway(end)) for end in ENDS]
    return [*commands, _write(radio, AIR, "ipv4/ip_forward", "1")]


def take_down(radio: Radio) -> list[Command]:
    """Return what removes the namespaces, and all that is in them; those that are not there make it fail."""
    return [("ip", "netns", "delete", radio.namespace(part)) for part in (DRONE, AIR, GROUND)]


def shape(radio: Radio, direction: Direction, condition: Condition) -> list[Command]:
    """Return what makes one direction of the radio be so, from the next packet on."""
    sender = radio.namespace(direction.sender)
    bucket = ("tc", "-n", sender, "qdisc", "replace", "dev", "radio", "root", "handle", "1:", *token_bucket(condition))
    out = ("tc", "-n", radio.namespace(AIR), "qdisc", "replace", "dev", direction.receiver, "root", "handle", "2:", *air(condition))
    return [bucket, out]


def token_bucket(condition: Condition) -> Command:
    """Return tbf's arguments."""
    rate_bps = max(round(condition.rate_bps), LEAST_RATE_BPS)
    limit_bytes = max(round(condition.rate_bps * condition.queue_s / 8.0), 2 * BURST_BYTES)
    return ("tbf", "rate", f"{rate_bps}bit", "burst", f"{BURST_BYTES}", "limit", f"{limit_bytes}")


def air(condition: Condition) -> Command:
    """Return netem's arguments: Gilbert-Elliott with the probabilities of the condition, all in percent."""
    words: list[str] = ["netem", "limit", f"{AIR_PACKETS}", "delay", f"{condition.delay_s * 1e3:g}ms"]
    if condition.jitter_s > 0.0:
        words += [f"{condition.jitter_s * 1e3:g}ms", "distribution", "normal"]
    if condition.rate_bps <= 0.0:
        words += ["loss", "100%"]
    else:
        chances = (condition.to_bad, condition.to_good, condition.burst_loss, condition.loss)
        words += ["loss", "gemodel", *(f"{100.0 * chance:g}%" for chance in chances)]
    return (*words, "rate", IN_ORDER)


def _link(radio: Radio, end: str) -> list[Command]:
    """Return what joins an end with the air: addresses, and neighbours that need no question."""
    here, there = radio.namespace(end), radio.namespace(AIR)
    mine, its = (f"02:00:00:00:{1 + ENDS.index(end):02x}:{host:02x}" for host in (1, 2))
    return [
        ("ip", "link", "add", "radio", "address", mine, "netns", here, "type", "veth", "peer", "name", end, "address", its, "netns", there),
        _ip(radio, end, "address", "add", f"{radio.address(end)}/24", "dev", "radio"),
        _ip(radio, AIR, "address", "add", f"{_gateway(end)}/24", "dev", end),
        _ip(radio, end, "link", "set", "radio", "up"),
        _ip(radio, AIR, "link", "set", end, "up"),
        _ip(radio, end, "neighbour", "replace", _gateway(end), "lladdr", its, "dev", "radio", "nud", "permanent"),
        _ip(radio, AIR, "neighbour", "replace", radio.address(end), "lladdr", mine, "dev", end, "nud", "permanent"),
    ]


def _gateway(end: str) -> str:
    return f"10.77.{1 + ENDS.index(end)}.2"


def _ip(radio: Radio, part: str, *words: str) -> Command:
    return ("ip", "-n", radio.namespace(part), *words)


def _write(radio: Radio, part: str, name: str, value: str, *, optional: bool = False) -> Command:
    path = f"/proc/sys/net/{name}"
    script = f"echo {value} > {path}"
    return ("ip", "netns", "exec", radio.namespace(part), "sh", "-c", f"[ ! -e {path} ] || {script}" if optional else script)
