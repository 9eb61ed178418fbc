"""The simulation without ROS."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from alula import parts

from rover_simulator.drawing import draw
from rover_simulator.errors import WorldError
from rover_simulator.faults import FAULTS
from rover_simulator.lockstep import LEAST_SHARE, Lockstep, ProcessorShare
from rover_simulator.person import Person
from rover_simulator.simulation import Simulation
from rover_simulator.world import load_world

WORLD = Path(__file__).parents[4] / "worlds/office.yaml"


def driven(faults="", seconds=10.0, v=-0.3, w=0.2):
    simulation = Simulation(load_world(WORLD), seed=4, faults=parts.parse_faults(faults, FAULTS))
    while simulation.now_s < seconds:
        simulation.wheels.command(v, w, simulation.now_s)
        simulation.step()
    return simulation


def test_the_same_seed_and_commands_give_the_same_drive():
    one, other = driven(), driven()
    assert one.state == other.state
    assert one.wheels.odometry == other.wheels.odometry
    assert np.array_equal(one.sweep().ranges_m, other.sweep().ranges_m)


def test_the_map_that_comes_with_the_world_is_drawn_of_it():
    picture = WORLD.with_name("office_map.pgm").read_bytes()
    assert picture.endswith(draw(load_world(WORLD)).tobytes())


def test_it_charges_in_the_dock_and_empties_outside():
    docked = driven(v=0.0, w=0.0, seconds=3.0)
    assert docked.truth.charging
    assert docked.battery.percent == pytest.approx(86.0, abs=0.5)
    assert driven().battery.percent < driven(seconds=2.0).battery.percent
    assert driven("battery@1").battery.percent < driven().battery.percent - 4.0


def test_a_wall_stops_it_and_is_felt():
    simulation = driven(v=0.5, w=0.0)
    assert simulation.bumper
    assert simulation.floor.touched == ("dock",)
    assert simulation.truth.collisions == 0  # the dock is there to be touched
    assert driven(v=-0.5, w=0.5, seconds=25.0).truth.collisions > 0


def test_a_command_that_is_not_repeated_ends():
    simulation = Simulation(load_world(WORLD), seed=4)
    simulation.wheels.command(-0.5, 0.0, 0.0)
    for _ in range(40):
        simulation.step()
    assert simulation.wheels.odometry_speed == (0.0, 0.0)


def test_doors_open_unless_they_fail():
    simulation = driven("door:kitchen")
    assert simulation.open_door("store", wide=True) == ""
    assert simulation.open_door("kitchen", wide=True) == "the door 'kitchen' does not answer"
    assert simulation.truth.doors_open == []
    simulation.step()
    assert simulation.truth.doors_open == ["store"]


def test_times_of_faults_count_from_the_departure_and_changes_are_told():
    simulation = driven("laser@2-4")
    changes = [(change["sensor"], change["mode"], change["t_s"]) for change in simulation.state["faults"]]
    departed_s = simulation.truth.departed_s
    assert changes == [
        ("laser", "dead", pytest.approx(departed_s + 2.0, abs=0.06)),
        ("laser", "ok", pytest.approx(departed_s + 4.0, abs=0.06)),
    ]


def test_a_person_answers_after_a_while_unless_silent():
    for silent in (False, True):
        simulation = Simulation(load_world(WORLD), seed=0)
        simulation.person.ask("load parcel", 1.0)
        assert simulation.person.answer(2.0, silent=silent) == ""
        assert simulation.person.answer(6.0, silent=silent) == ("" if silent else "done load parcel")
        assert simulation.person.answer(7.0, silent=silent) == ""


def test_a_person_who_waits_before_the_rover_goes_back_when_asked():
    person, here, rover = Person([(0.0, 0.0), (5.0, 0.0)], (9.0, 9.0)), (2.0, 0.0), (2.6, 0.2, 0.0)
    assert person.velocity(here, rover, stays=False) == (0.0, 0.0)
    person.ask("let me pass", 1.0)
    assert person.answer(5.0, silent=False) == "done let me pass"
    assert person.velocity(here, rover, stays=False)[0] < 0.0
    person.ask("load parcel", 6.0)  # nobody is in anybody's way now
    assert person.answer(10.0, silent=False)
    assert person.velocity(here, rover, stays=False)[0] < 0.0


def test_what_can_not_be_read_is_refused(tmp_path):
    with pytest.raises(parts.FaultError, match="laser can't be 'purple'"):
        parts.parse_faults("laser:purple", FAULTS)
    with pytest.raises(WorldError, match="No such file"):
        load_world(tmp_path / "no.yaml")
    (tmp_path / "bad.yaml").write_text(WORLD.read_text(encoding="utf-8").replace("dock: [0.57, 5.4, 3.14]", "dock: [0.57]"))
    with pytest.raises(WorldError, match="should be 3 numbers"):
        load_world(tmp_path / "bad.yaml")


def test_time_waits_for_those_that_lag_and_not_for_the_dead():
    lockstep = Lockstep(["/a", "/b=0.3"], 10.0)
    assert lockstep.lagging(5.0, 0.0) == []  # nobody has been heard yet
    lockstep.heard("/a", 5.0)
    lockstep.heard("/b", 5.0)
    assert lockstep.lagging(5.1, 0.0) == []
    assert lockstep.lagging(5.15, 0.0) == ["/a"]
    assert lockstep.lagging(5.35, 0.0) == ["/a", "/b"]
    lockstep.gone("/b")
    assert lockstep.left_out == ["/b"]
    assert lockstep.lagging(5.35, 9.0) == ["/a"]
    assert lockstep.lagging(5.35, 11.0) == []  # it hangs
    assert lockstep.left_out == ["/a", "/b"]
    lockstep.heard("/a", 5.3)
    assert lockstep.left_out == ["/b"]
    assert lockstep.lagging(5.45, 11.0) == ["/a"]


def test_time_waits_for_those_who_have_the_odometry_and_not_yet_the_scans_of_that_time():
    lockstep = Lockstep(["/health/done", "/health/scans=scans"], 10.0)
    for topic in lockstep.topics:
        lockstep.heard(topic, 5.0)
    for step in range(1, 41):  # no scan comes: the laser is dead, and who takes scans has nothing to take
        lockstep.heard("/health/done", 5.0 + 0.05 * step)
        assert lockstep.lagging(5.0 + 0.05 * step, 0.0) == []
    lockstep.scanned(7.05)
    lockstep.heard("/health/scans", 7.05)
    lockstep.scanned(7.15)
    lockstep.heard("/health/done", 7.25)
    assert lockstep.lagging(7.25, 0.0) == []  # the last scan may be under way
    lockstep.scanned(7.25)
    assert lockstep.lagging(7.25, 0.0) == ["/health/scans"]
    lockstep.heard("/health/scans", 7.15)
    assert lockstep.lagging(7.25, 0.0) == []
    lockstep.scanned(7.35)
    lockstep.heard("/health/scans", 7.35)  # one of them got lost on the way
    assert lockstep.lagging(7.35, 0.0) == []
    lockstep.gone("/health/scans")
    lockstep.scanned(7.45)
    lockstep.scanned(7.55)
    assert lockstep.lagging(7.35, 0.0) == []


def test_the_share_of_a_processor_is_what_steps_get_of_it_lately():
    processor = ProcessorShare()
    processor.worked(0.0, 0.0)
    assert processor.share == 1.0
    for _ in range(200):
        processor.worked(0.02, 0.002)
    assert processor.share == pytest.approx(0.1, abs=0.01)
    for _ in range(200):
        processor.worked(0.002, 0.0025)  # clocks are coarse
    assert processor.share == pytest.approx(1.0, abs=0.01)
    for _ in range(500):
        processor.worked(1.0, 0.0)
    assert processor.share == pytest.approx(LEAST_SHARE, abs=0.001)
