"""Networks of a test's own: what is cut, and what is not."""

import socket
import subprocess
import time

from alula_testing.networks import Network
from alula_testing.waits import HANGS_S


def reaches(one, other):
    """Return whether a connection to a closed port is refused, which takes a packet there and one back."""
    probe = f"exec 3<>/dev/tcp/{other.address}/9"
    done = subprocess.run(one.command("timeout", "0.5", "bash", "-c", probe), capture_output=True, text=True, check=False)
    return "refused" in done.stderr


def test_three_computers_reach_each_other_until_a_link_is_cut():
    with Network() as network:
        base, decision, here = network.computer("base"), network.computer("decision"), network.here()
        for one, other in ((base, decision), (here, base), (decision, here)):
            network.wait_reached(one, other)
        with network.cut(base, decision):
            assert not reaches(base, decision)
            assert not reaches(decision, base)
            assert reaches(here, base)
            assert reaches(decision, here)
        assert reaches(base, decision)


def test_cut_of_one_direction_and_change_of_an_address():
    with Network() as network:
        base, here = network.computer("base"), network.here()
        network.wait_reached(here, base)
        with network.cut(here, base, one_way=True):
            assert not reaches(here, base)
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
                receiver.bind((here.address, 0))
                receiver.settimeout(HANGS_S)
                send = f"echo hello > /dev/udp/{here.address}/{receiver.getsockname()[1]}"
                subprocess.run(base.command("bash", "-c", send), check=True)
                assert receiver.recv(100) == b"hello\n"
        old = base.address
        network.move(base)
        assert base.address != old
        assert reaches(here, base)
        known = subprocess.run(here.command("getent", "hosts", "base"), capture_output=True, text=True, check=True).stdout
        assert known.split() == [base.address, "base"]


def test_a_computer_without_its_address_answers_nothing_and_tells_nobody():
    with Network() as network:
        base, here = network.computer("base"), network.here()
        network.wait_reached(here, base)
        with socket.create_server((here.address, 0)) as server:
            server.settimeout(HANGS_S)
            talk = f"exec 3<>/dev/tcp/{here.address}/{server.getsockname()[1]}; while read -r line <&3; do echo $line >&3; done"
            with subprocess.Popen(base.command("bash", "-c", talk)) as peer, server.accept()[0] as connection:
                connection.settimeout(HANGS_S)
                with network.without_address(base):
                    assert not reaches(here, base)
                    connection.sendall(b"hello\n")
                assert connection.recv(100) == b"hello\n", "sent again, to an end that knows nothing of it"
                peer.kill()


def test_a_bad_cable_delays_and_loses_and_changes_nothing():
    delay_s, sent = 0.1, b"0123456789" * 20_000
    with Network() as network:
        base, here = network.computer("base"), network.here()
        network.wait_reached(here, base)
        with network.bad_cable(base, delay_s=delay_s, loss=0.0, seed=1), socket.create_server((here.address, 0)) as server:
            server.settimeout(HANGS_S)
            begun_s = time.monotonic()
            echo = f"exec 3<>/dev/tcp/{here.address}/{server.getsockname()[1]}; head -c {len(sent)} <&3 | cat >&3"
            with subprocess.Popen(base.command("bash", "-c", echo)), server.accept()[0] as connection:
                connection.settimeout(HANGS_S)
                connection.sendall(sent)
                with connection.makefile("rb") as back:
                    assert back.read(len(sent)) == sent
            assert time.monotonic() - begun_s >= 4 * delay_s, "to connect, and there and back"
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
            receiver.bind((here.address, 0))
            receiver.settimeout(HANGS_S)
            to = f"/dev/udp/{here.address}/{receiver.getsockname()[1]}"
            with network.bad_cable(base, delay_s=0.0, loss=0.5, seed=1):
                subprocess.run(base.command("bash", "-c", f"for n in $(seq 200); do echo $n > {to}; done"), check=True)
            subprocess.run(base.command("bash", "-c", f"echo over > {to}"), check=True)
            heard = list(iter(lambda: receiver.recv(100), b"over\n"))
        assert 0 < len(heard) < 200


def test_nothing_is_left_of_a_network():
    with Network() as network:
        here = network.here()
        assert subprocess.run(["ip", "link", "show", here.interface], capture_output=True, check=False).returncode == 0
    gone = subprocess.run(["ip", "link", "show", here.interface], capture_output=True, text=True, check=False)
    assert "does not exist" in gone.stderr
