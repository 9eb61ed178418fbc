"""Throw garbage at a running bridge: ``python -m bridge_tools.fuzz --seconds 60 --up /a --down /b`` (String topics that it carries).

Broken and random frames, connection headers and definitions from a publisher; random bytes, and real requests with bytes changed, to its
XML-RPC and TCPROS ports; with ``--service /c`` (a SetBool that it offers in ROS 1) broken headers and requests of that service's clients.
Prints figures as JSON; ends with 1 when the bridge no longer answers. The same seed throws the same things.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import socket
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import psutil

from bridge_tools.hostile import LENGTH, WITHIN_S, HostilePublisher, master, open_ports
from ros_bridge.tcpros import encode_header

STRING = {"type": "std_msgs/String", "md5sum": "992ce8a1687cec8c8bd883ec73ca41d1", "message_definition": "string data\n"}
SET_BOOL = {"md5sum": "09fb03525b03e7ea1fd3992bafd87e16", "persistent": "1"}
REQUESTS = (
    encode_header({"callerid": "/fuzz", "topic": "{down}", **STRING}),
    b"POST /RPC2 HTTP/1.1\r\nHost: a\r\nContent-Type: text/xml\r\nContent-Length: 93\r\n\r\n"
    b"<?xml version='1.0'?><methodCall><methodName>getPid</methodName><params></params></methodCall>",
)
WORDS = (
    "",
    "string data",
    "uint32[4000000000] a",
    "a/B c",
    "Header header",
    "=" * 80,
    "MSG: x/Y",
    "int32 a=",
    "\0",
    "string data\nint8[] b",
)


@dataclass
class FuzzFigures:
    """What was thrown, and what became of the bridge."""

    thrown: int = 0
    seconds: float = 0.0
    grown_mb: float = 0.0
    alive: bool = False


def memory_mb(pid: int) -> float:
    """Return a process's resident memory."""
    return float(psutil.Process(pid).memory_info().rss) / (1 << 20)


def mutated(data: bytes, dice: random.Random) -> bytes:
    """Change, cut or lengthen some bytes."""
    changed = bytearray(data)
    for _ in range(dice.randint(1, 8)):
        position = dice.randrange(len(changed) + 1)
        match dice.randrange(4):
            case 0:
                changed[position : position + 1] = dice.randbytes(1)
            case 1:
                changed[position : position + 4] = LENGTH.pack(dice.choice((0, 1, 0x7FFFFFFF, 0xFFFFFFFF, dice.getrandbits(32))))
            case 2:
                del changed[position:]
            case _:
                changed[position:position] = dice.randbytes(dice.randint(1, 64))
    return bytes(changed)


def frames(dice: random.Random) -> bytes:
    """Return what a publisher sends behind its header: messages that may end early, lie about their lengths, or be none."""
    sent = b""
    for _ in range(dice.randint(0, 5)):
        text = dice.randbytes(dice.randint(0, 40))
        message = LENGTH.pack(len(text)) + text
        sent += LENGTH.pack(len(message)) + message
    return mutated(sent, dice) if dice.random() < 0.8 else dice.randbytes(200)


def reply(dice: random.Random) -> bytes:
    """Return a publisher's header: right, with another definition, with bytes changed, or random."""
    fields = STRING | {"callerid": "/fuzz", "latching": "1"}
    if dice.random() < 0.5:
        fields["message_definition"] = "\n".join(dice.choices(WORDS, k=3))
    return dice.choice((encode_header(fields), encode_header(fields), mutated(encode_header(fields), dice), dice.randbytes(60)))


class Fuzzer:
    """One run against one bridge."""

    def __init__(self, master_uri: str, up: str, down: str, seed: int, service: str = "") -> None:
        """Find the bridge by the topic that it publishes in ROS 1; services are on the same port."""
        self._master_uri, self._up, self._down, self._service = master_uri, up, down, service
        self._dice = random.Random(seed)  # noqa: S311 - repeatable, not secret
        self._ports = open_ports(master_uri, down)
        self.pid = self._ask_pid()

    def _ask_pid(self) -> int:
        with master(f"http://{self._ports[0][0]}:{self._ports[0][1]}/") as node:
            answer: Any = node.getPid("/fuzz")
        return int(answer[2])

    def _publish(self) -> None:
        sent = frames(self._dice)
        name = f"/fuzz_{self._dice.getrandbits(32):x}"
        publisher = HostilePublisher(
            self._master_uri, self._up, STRING["type"], name=name, reply=reply(self._dice), talk=lambda connection: connection.sendall(sent)
        )
        publisher.served.wait(WITHIN_S)
        publisher.close()

    def _knock(self) -> None:
        request = self._dice.choice(REQUESTS).replace(b"{down}", self._down.encode())
        garbage = self._dice.choice((mutated(request, self._dice), self._dice.randbytes(self._dice.randint(0, 300))))
        self._send(garbage, self._dice.choice(self._ports))

    def _call(self) -> None:
        greeting = encode_header(SET_BOOL | {"callerid": "/fuzz", "service": self._service, "probe": self._dice.choice("01")})
        if self._dice.random() < 0.3:
            greeting = mutated(greeting, self._dice)
        calls = (LENGTH.pack(1) + self._dice.randbytes(1)) * self._dice.randint(0, 5)
        self._send(greeting + self._dice.choice((calls, mutated(calls, self._dice), frames(self._dice))), self._ports[1])

    def _send(self, garbage: bytes, place: tuple[str, int]) -> None:
        with contextlib.suppress(OSError), socket.create_connection(place, timeout=WITHIN_S) as connection:
            connection.sendall(garbage)
            connection.settimeout(0.02)
            connection.recv(1000)

    def run(self, seconds: float) -> FuzzFigures:
        """Throw for a time; the first second's memory is where growth is counted from."""
        figures = FuzzFigures()
        start_s = time.monotonic()
        before_mb = 0.0
        throws: list[Callable[[], None]] = [self._publish, self._knock, self._knock, self._knock]
        throws += [self._call] * 3 if self._service else []
        while (elapsed_s := time.monotonic() - start_s) < seconds and psutil.pid_exists(self.pid):
            if not before_mb and elapsed_s > min(1.0, seconds / 2):
                before_mb = memory_mb(self.pid)
            self._dice.choice(throws)()
            figures.thrown += 1
        figures.seconds = round(time.monotonic() - start_s, 1)
        with contextlib.suppress(OSError):
            figures.alive = self._ask_pid() == self.pid
            figures.grown_mb = round(memory_mb(self.pid) - before_mb, 1)
        return figures


def main(arguments: Sequence[str] | None = None) -> int:
    """Throw, print the figures, and return 0 if the bridge still answers."""
    parser = argparse.ArgumentParser(prog="bridge_tools.fuzz", description="Send malformed data to a running bridge on this machine.")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--up", default="/fuzz/up", help="std_msgs/String topic that the bridge carries to ROS 2")
    parser.add_argument("--down", default="/fuzz/down", help="std_msgs/String topic that the bridge carries to ROS 1")
    parser.add_argument("--service", default="", help="std_srvs/SetBool service that the bridge offers in ROS 1")
    options = parser.parse_args(arguments)
    master_uri = os.environ.get("ROS_MASTER_URI", "http://127.0.0.1:11311")
    figures = Fuzzer(master_uri, options.up, options.down, options.seed, options.service).run(options.seconds)
    sys.stdout.write(json.dumps(asdict(figures)) + "\n")
    return 0 if figures.alive else 1


if __name__ == "__main__":
    sys.exit(main())
