"""Ports that processes of one machine don't take from each other."""

from __future__ import annotations

import socket
import subprocess
import sys

from alula.common import network

CHILD = "import sys; from alula.common import network; network.PORTS = [int(w) for w in sys.argv[1:]]; print(network.free_port())"


def test_a_port_that_was_given_is_given_to_no_other_process(monkeypatch):
    *ports, other = (network.free_port() for _ in range(3))
    network._claims.pop().close()  # that of the other one
    monkeypatch.setattr(network, "PORTS", [*ports, other])
    assert network.free_port() == other
    network._claims.pop().close()
    words = [sys.executable, "-c", CHILD, *map(str, [*ports, other])]
    assert {int(subprocess.run(words, capture_output=True, check=True).stdout) for _ in range(8)} == {other}


def test_ports_in_a_row_are_all_free_and_given_to_nobody_else(monkeypatch):
    held, free = network.free_port(2), network.free_port(2)
    for _ in range(4):
        network._claims.pop().close()
    monkeypatch.setattr(network, "PORTS", [held, held + 1, free, free + 1])
    with socket.socket() as of_another_program:
        of_another_program.bind(("127.0.0.1", held + 1))
        assert network.free_port(2) == free
        assert network.free_port() == held
    assert network.free_port() == held + 1


def test_only_the_latest_claims_of_a_process_are_kept():
    for _ in range(network.CLAIMED_PORTS + 1):
        network.free_port()
    assert len(network._claims) == network.CLAIMED_PORTS
