"""What keeps the parts of a deployment up."""

from __future__ import annotations

import os
import signal
import socket
import sys
from dataclasses import replace

from station_rig import sleeper

from alula_flight.station import keeper as keepers
from alula_flight.station import state as states
from alula_flight.station.keeper import Kept as KeptPart
from alula_flight.station.keeper import differences
from alula_flight.station.notify import VARIABLE, notify
from alula_flight.station.parts import Part
from alula_flight.station.state import PartState
from alula_testing.waits import until


def turned(one, condition, what):
    def turn():
        one.look()
        return condition()

    until(turn, what)


def test_a_part_that_is_killed_is_started_again(kept, monkeypatch):
    monkeypatch.setattr(keepers, "LIVES_S", 0.0)
    one = kept(sleeper())
    turned(one, lambda: one.state.state == states.RUNNING, "it runs")
    first = one.state.pid
    os.kill(first, signal.SIGKILL)
    turned(one, lambda: one.state.pid not in {0, first}, "it runs again")
    assert (one.state.deaths, one.state.why.partition(":")[0]) == (1, "signal SIGKILL")


def test_a_part_that_looks_dead_before_all_of_its_threads_are_tells_how_it_ended(kept, monkeypatch):
    one = kept(sleeper())
    one.look()
    with monkeypatch.context() as looks_dead:
        looks_dead.setattr(PartState, "process", None)
        one.look()
        assert one.state.deaths == 0
        os.kill(one.state.pid, signal.SIGKILL)
        turned(one, lambda: one.state.deaths, "its end is seen")
    assert one.state.why.partition(":")[0] == "signal SIGKILL"


def test_a_part_that_says_that_it_can_not_run_is_not_started_again_until_it_is_asked_for(kept):
    one = kept(Part("bridge", (sys.executable, "-c", "import sys; print('no such file'); sys.exit(2)"), os.environ))
    turned(one, lambda: one.state.state == states.REFUSED, "it is refused")
    assert (one.state.deaths, one.state.why) == (1, "exit code 2: no such file")
    assert not one.look()
    one.forgive()
    turned(one, lambda: one.state.deaths == 2, "it has been tried once more")


def test_a_part_that_dies_again_and_again_is_given_up(kept):
    one = kept(Part("bridge", (sys.executable, "-c", "raise SystemExit(1)"), os.environ))
    turned(one, lambda: one.state.state == states.GIVEN_UP, "it is given up")
    assert one.state.deaths == keepers.DEATHS


def test_a_part_is_started_again_that_was_started_with_something_else(kept):
    one = kept(replace(sleeper(), contents={"skill drive": "1"}))
    turned(one, lambda: one.state.state == states.STARTING, "it is started")
    first = one.state.pid
    assert not one.differs
    one.part = replace(one.part, contents={"skill drive": "2", "skill park": "1"})
    assert one.differs
    assert differences(one.state, one.part) == ["new: skill park", "changed: skill drive"]
    one.end()
    turned(one, lambda: one.state.pid not in {0, first}, "it is started again")
    assert not one.differs


def test_another_keeper_takes_over_what_runs_and_sees_what_is_different_by_now(kept, places):
    one = kept(sleeper(ROS_DOMAIN_ID="7"))
    one.look()
    taken = KeptPart(one.part, one.state, places)
    assert not taken.differs
    assert not taken.look()
    assert KeptPart(sleeper(ROS_DOMAIN_ID="8"), one.state, places).differs
    os.kill(one.state.pid, signal.SIGKILL)
    one._child.wait()
    taken.look()
    assert (taken.state.state, taken.state.deaths) == (states.WAITING, 1)


def test_a_log_that_has_become_long_begins_anew_and_is_kept_beside(kept, monkeypatch):
    one = kept(sleeper())
    one.log.write_text("x" * 100)
    one.cut_log()
    assert one.log.stat().st_size == 100
    monkeypatch.setattr(keepers, "LOG_BYTES", 99)
    one.cut_log()
    assert (one.log.stat().st_size, one.log.with_suffix(".1.log").stat().st_size) == (0, 100)


def test_systemd_is_told_where_it_listens_and_nobody_else(tmp_path, monkeypatch):
    monkeypatch.delenv(VARIABLE, raising=False)
    notify("READY=1")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(str(tmp_path / "s"))
        monkeypatch.setenv(VARIABLE, str(tmp_path / "s"))
        notify("WATCHDOG=1")
        assert systemd.recv(100) == b"WATCHDOG=1"
    notify("WATCHDOG=1")  # gone
