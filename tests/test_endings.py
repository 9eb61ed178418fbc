"""However a flight ends, nothing runs on, the vehicle is down, and what happened can be read."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from functools import partial
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


def says_death(flight: Flight, victim: str) -> bool:
    return f" {victim} died (signal SIGKILL)" in flight.words()


def test_second_ctrl_c_ends_at_once(fly: StartFlight) -> None:
    flight = fly()
    flight.wait_running("goto_straight")
    flight.process.send_signal(signal.SIGINT)
    flight.wait_for("the first Ctrl-C is heard", lambda: "Ctrl-C again" in flight.words())
    flight.process.send_signal(signal.SIGINT)
    flight.end(1)
    assert flight.summary["landed"] is not True


@pytest.mark.parametrize("victim", ["mission", "uav_simulator", "supervisor"])
def test_killed_process_ends_the_run_and_is_named(fly: StartFlight, victim: str) -> None:
    flight = fly()
    flight.wait_in_air()
    os.kill(flight.processes()[victim], signal.SIGKILL)
    flight.end(1)
    assert victim in died(flight)
    assert says_death(flight, victim)
    if victim != "uav_simulator":
        assert flight.summary["landed"] is True


def test_killed_front_leaves_nothing_and_the_vehicle_lands(fly: StartFlight) -> None:
    flight = fly()
    flight.wait_in_air()
    flight.process.send_signal(signal.SIGKILL)
    flight.process.wait()
    end_seen = flight.out / "summary.json"

    def over() -> bool:
        return end_seen.exists() and not flight.left_over()

    until(over, "the vehicle is down and nothing is left over", 300.0)
    assert flight.summary["landed"] is True
    assert "front" in died(flight)


# Each flight loses some nodes, one after the other. The recorder is the last of its flight: it stays away, nothing is on record after it.
LOST_NODES = {"functional": ("zed_depth", "record"), "skills": ("navigation", "uav_guidance", "ros_bridge")}


def lose(flight: Flight, victims: Sequence[str]) -> None:
    """Kill nodes of a flight, and wait until each death is said."""
    for victim in victims:
        os.kill(flight.processes()[victim], signal.SIGKILL)
        flight.wait_for(f"{victim}'s death is said", partial(says_death, flight, victim))


@pytest.mark.parametrize("place", LOST_NODES)
def test_killed_nodes_are_named_and_ctrl_c_lands_first(fly: StartFlight, place: str) -> None:
    flight = fly()
    flight.wait_running("goto_straight")
    lose(flight, LOST_NODES[place])
    os.killpg(flight.process.pid, signal.SIGINT)  # as a terminal does it
    flight.end(1)
    assert died(flight) == set(LOST_NODES[place])
    assert flight.summary["landed"] is True
    assert flight.summary["collisions"] == 0
    if place == "functional":  # the mission goes on without these, until it is told to end
        assert flight.summary["outcome"] == "aborted"
