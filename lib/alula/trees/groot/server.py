"""Serves a tree to viewers of BehaviorTree.CPP 4's Groot2 protocol over ZeroMQ: Groot2, btview and their like.

A thread answers; the mission only stores into `NodeStates`, so no viewer holds it up. Any number of viewers come and go. To one that asks
and does not read, some replies are kept and the rest dropped.

Breakpoints and results set by a viewer are refused: a robot that flies is not held in the middle of a tick, and does what its mission
says. So the publisher, where the protocol tells of breakpoints that were reached, is open and silent.
"""

from __future__ import annotations

import os
import uuid
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from threading import Thread

import zmq

from alula.common.network import free_port
from alula.trees.groot.address import PORTS_IN_A_ROW, Address, taken
from alula.trees.groot.protocol import REFUSAL, Header, ProtocolError, Request
from alula.trees.groot.states import Shown
from alula.trees.groot.values import pack_values

KEPT_MESSAGES = 50
"""For each viewer, in each direction."""
LONGEST_REQUEST_BYTES = 1 << 16
NO_HOOKS = "a mission takes no breakpoints and no results from a viewer"
NO_HOOK = "Node ID not found"
TWO_PARTS = "must be 2 parts message"

Handler = Callable[[Shown, str], list[bytes]]


@dataclass(frozen=True)
class _Served:
    """What is served: a tree, and the number by which viewers tell it from another one."""

    shown: Shown
    number: bytes = field(default_factory=lambda: uuid.uuid4().bytes)


class Server:
    """Answers requests from when it is made until it is closed."""

    def __init__(self, shown: Shown, address: Address | None = None) -> None:
        """Raises ServerError when the ports can't be had."""
        self._served = _Served(shown)
        self._context = zmq.Context()
        self._replies = self._socket(zmq.REP)
        self._publisher = self._socket(zmq.PUB)
        self.address = self._bind(address or Address())
        self._closing = self._context.socket(zmq.PAIR)
        self._closing.bind("inproc://closing")
        self._thread = Thread(target=self._serve, name="groot", daemon=True)
        self._thread.start()

    def show(self, shown: Shown) -> None:
        """Serve another tree from now on, by another number: viewers ask for it anew."""
        self._served = _Served(shown)

    def close(self) -> None:
        """End; viewers that wait for a reply get none."""
        if self._context.closed:
            return
        with self._context.socket(zmq.PAIR) as told:
            told.connect("inproc://closing")
            told.send(b"")
            self._thread.join()
        self._context.destroy(linger=0)

    # --- sockets -----------------------------------------------------------------------------------------------------

    def _socket(self, kind: int) -> zmq.Socket[bytes]:
        socket = self._context.socket(kind)
        for option, value in (
            (zmq.LINGER, 0),
            (zmq.SNDHWM, KEPT_MESSAGES),
            (zmq.RCVHWM, KEPT_MESSAGES),
            (zmq.MAXMSGSIZE, LONGEST_REQUEST_BYTES),
        ):
            socket.setsockopt(option, value)
        return socket

    def _bind(self, wanted: Address) -> Address:
        address = Address(wanted.host, wanted.port or free_port(PORTS_IN_A_ROW))
        try:
            self._replies.bind(f"tcp://{address.host}:{address.port}")
            self._publisher.bind(f"tcp://{address.host}:{address.port + 1}")
        except zmq.ZMQError as error:
            self._context.destroy(linger=0)
            raise taken(address, os.strerror(error.errno or 0)) from error
        return address

    def _serve(self) -> None:
        poller = zmq.Poller()
        poller.register(self._replies, zmq.POLLIN)
        poller.register(self._closing, zmq.POLLIN)
        while self._closing not in dict(poller.poll()):
            self._replies.send_multipart(self._answer(self._replies.recv_multipart()))

    # --- answers -----------------------------------------------------------------------------------------------------

    def _answer(self, parts: Sequence[bytes]) -> list[bytes]:
        try:
            header, served = Header.read(parts[0]), self._served
            return [header.reply(served.number), *_content(served.shown, header.request, parts[1:])]
        except ProtocolError as error:
            return [REFUSAL, str(error).encode()]
        except Exception as error:  # noqa: BLE001 - what one viewer asks for must not end the service of the others
            return [REFUSAL, f"{type(error).__name__}: {error}".encode()]


def _content(shown: Shown, request: Request, more: Sequence[bytes]) -> list[bytes]:
    if request in WITH_MORE and len(more) != 1:
        raise ProtocolError(TWO_PARTS)
    return HANDLERS[request](shown, more[0].decode("utf-8", "replace") if more else "")


def _values(shown: Shown, names: str) -> list[bytes]:
    wanted = {name: shown.values[name] for name in names.split(";") if name in shown.values}
    return [pack_values({name: values() for name, values in wanted.items()})]


def _record(shown: Shown, command: str) -> list[bytes]:
    if command == "start":
        return [str(shown.states.start()).encode()]
    if command == "stop":
        shown.states.stop()
    return []


def _refuse(sentence: str) -> Handler:
    def refuse(_shown: Shown, _more: str) -> list[bytes]:
        raise ProtocolError(sentence)

    return refuse


HANDLERS: Mapping[Request, Handler] = {
    Request.FULL_TREE: lambda shown, _: [shown.xml.encode()],
    Request.STATUS: lambda shown, _: [shown.states.codes()],
    Request.BLACKBOARD: _values,
    Request.TOGGLE_RECORDING: _record,
    Request.GET_TRANSITIONS: lambda shown, _: [shown.states.fetch()],
    Request.HOOKS_DUMP: lambda _shown, _: [b"[]"],
    Request.REMOVE_ALL_HOOKS: lambda _shown, _: [],
    Request.DISABLE_ALL_HOOKS: lambda _shown, _: [],
    Request.HOOK_INSERT: _refuse(NO_HOOKS),
    Request.HOOK_REMOVE: _refuse(NO_HOOK),
    Request.BREAKPOINT_UNLOCK: _refuse(NO_HOOK),
}
WITH_MORE = {Request.BLACKBOARD, Request.TOGGLE_RECORDING, Request.HOOK_INSERT, Request.HOOK_REMOVE, Request.BREAKPOINT_UNLOCK}
"""Requests that have a second part."""
