"""However a flight ends, nothing runs on, the vehicle is down, and what happened can be read."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from alula_testing.flights import Flight, start_flight
from alula_testing.waits import until

pytestmark = [pytest.mark.flight, pytest.mark.timeout(600)]
StartFlight = Callable[..., Flight]


@pytest.fixture
def fly(tmp_path: Path) -> Iterator[StartFlight]:
    flights: list[Flight] = []

    def start(*arguments: str) -> Flight:
        flights.append(start_flight(tmp_path / f"run{len(flights)}", "--rate", "0", *arguments))
        return flights[-1]

    yield start
    for flight in flights:
        flight.give_up()


def died(flight: Flight) -> set[str]:
    return {death["name"] for death in flight.summary["died"]}


def test_ctrl_c_lands_first(fly: StartFlight) -> None:
    flight = fly()
    flight.wait_running("goto_straight")
    os.killpg(flight.process.pid, signal.SIGINT)
    assert flight.end() == 1
    assert flight.summary["landed"] is True
    assert flight.summary["outcome"] == "aborted"
    assert flight.summary["collisions"] == 0


def test_second_ctrl_c_ends_at_once(fly: StartFlight) -> None:
    flight = fly()
    flight.wait_running("goto_straight")
    flight.process.send_signal(signal.SIGINT)
    flight.wait_for("the first Ctrl-C is heard", lambda: "Ctrl-C again" in flight.words())
    flight.process.send_signal(signal.SIGINT)
    assert flight.end() == 1
    assert flight.summary["landed"] is not True


@pytest.mark.parametrize("victim", ["mission", "uav_simulator", "supervisor"])
def test_killed_process_ends_the_run_and_is_named(fly: StartFlight, victim: str) -> None:
    flight = fly()
    flight.wait_running("goto_straight")
    os.kill(flight.processes()[victim], signal.SIGKILL)
    assert flight.end() == 1
    assert victim in died(flight)
    assert victim in flight.words()
    if victim != "uav_simulator":
        assert flight.summary["landed"] is True


def test_killed_front_leaves_nothing_and_the_vehicle_lands(fly: StartFlight) -> None:
    flight = fly()
    flight.wait_running("goto_straight")
    flight.process.send_signal(signal.SIGKILL)
    flight.process.wait()
    end_seen = flight.out / "summary.json"

    def over() -> bool:
        return end_seen.exists() and not flight.left_over()

    until(over, "the vehicle is down and nothing is left over", 300.0)
    assert flight.summary["landed"] is True
    assert "front" in died(flight)


@pytest.mark.parametrize("victim", ["zed_depth", "uav_guidance", "ros_bridge", "navigation", "perception", "record"])
def test_killed_node_is_named_and_the_mission_still_ends(fly: StartFlight, victim: str) -> None:
    flight = fly()
    flight.wait_running("goto_straight")
    os.kill(flight.processes()[victim], signal.SIGKILL)
    flight.wait_for(f"{victim}'s death is said", lambda: victim in flight.words())
    flight.process.send_signal(signal.SIGINT)  # the rest of the mission is flown elsewhere; here it has to come down in order
    assert flight.end() == 1
    assert victim in died(flight)
    assert flight.summary["landed"] is True
    assert flight.summary["collisions"] == 0
