"""The drone's part of its runs, as ``robot.yaml`` names it."""

from __future__ import annotations

import json
import shutil
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

from alula.common.faults import parse_fault
from alula.common.files import folder_there
from alula.common.network import udp_ports_of
from alula.common.scenarios import Scenario, load_scenario
from alula.runtime.live.part import Clock, Consequence, RunPart
from alula.runtime.live.spec import RequestError, RunSpec
from uav_flight.autopilot import LISTENS, body_port, command_of_ardupilot, read_connection
from uav_flight.options import Options, add_options, read_options
from uav_simulator.errors import ConfigError
from uav_simulator.sensors.faults import FAULTS
from uav_simulator.settings import FOLLOWED
from uav_simulator.world.config import load_world

RADIO_PORT, RADIO_PORTS = 20_000, 10
SILENT_S = 5.0  # mission clock; of an older state of the guidance, nobody knows whether it still holds
OFF_GROUND = (2, 3, 4)  # uav_msgs/GuidanceState: in the air, taking off, landing
SENSORS_MB_S = 4.0  # stereo pair, LiDAR and IMU, compressed; measured in the yard


@dataclass(frozen=True)
class Flight:
    """The drone's settings of a run.

    Attributes:
        rate: simulated seconds per second at most; 0: no limit.
        record: what ``functional.bag`` holds: "functional", or "sensors" for the raw measurements, too.
        autopilot: MAVLink connection; None for the simulated vehicle.
        sensors: with an autopilot, "simulated" where the simulator has the body that it flies and the sensors, "followed:URL" where it has
            the sensors only, which are where the autopilot says over this connection, "" where real drivers run.
        imperfections: of the simulated autopilot and sensors.
        mavlink_port: TCP port of the simulated autopilot.
        body_port: UDP port where ArduPilot's simulator looks for the body, with sensors "simulated"; 0 until the run's domain is known.
        radio_port: the first of the radio's ten; 0 until then.
    """

    rate: float = 1.0
    record: str = "functional"
    autopilot: str | None = None
    sensors: str = ""
    imperfections: str = "off"
    mavlink_port: int = 0
    body_port: int = 0
    radio_port: int = 0

    @classmethod
    def of(cls, spec: RunSpec) -> Flight:
        """Return the drone's settings of a run."""
        return cls(**{one.name: spec.own[one.name] for one in fields(cls) if one.name in spec.own})

    @property
    def simulated(self) -> bool:
        """Return whether the simulator takes part, with its clock, its truth and its sensors."""
        return self.autopilot is None or bool(self.sensors)


class DronePart(RunPart):
    """What the drone adds to a run."""

    faults = FAULTS
    consequences: Mapping[str, Consequence] = {"uav_simulator": Consequence.END}
    stays_dead: Mapping[str, Consequence] = {"ros_bridge": Consequence.REST}
    cameras: Mapping[str, str] = {"depth": "/zed_depth/depth", "screen": "/ground_station/screen"}

    def __init__(self) -> None:
        self._linked = False
        self._guidance: Any = None
        """The last state of the guidance."""
        self._seen: tuple[Any, float] = (None, 0.0)
        """The state that was looked at last, and when that was first done, mission clock: its stamp is of another computer."""
        self._landing: Any = None
        self._subscribers: list[Any] = []

    # --- in the front -------------------------------------------------------------------------------------------------

    def add_options(self, parser: ArgumentParser) -> None:
        """Add rate, recording, autopilot, sensors and imperfections."""
        add_options(parser)

    def read(self, given: Namespace, scenario: Scenario) -> Mapping[str, Any]:  # noqa: ARG002
        """Return the drone's options as fields of the run; raises RequestError where they do not go together."""
        return read_options(Options(**vars(given)))

    def check_world(self, path: str) -> None:
        """Refuse a world that the simulator can't build."""
        try:
            load_world(Path(path))
        except ConfigError as error:
            raise RequestError(f"--world: {error}") from None

    def claim(self, spec: RunSpec) -> Mapping[str, Any]:
        """Return the drone's settings with the UDP ports that this run alone uses."""
        flight = Flight.of(spec)
        port = flight.body_port
        if flight.sensors == "simulated" and flight.autopilot is not None and not port:
            port = body_port(read_connection(flight.autopilot), spec.seat)
        radio_port = udp_ports_of(spec.seat, first=RADIO_PORT, step=RADIO_PORTS, count=RADIO_PORTS)
        return asdict(replace(flight, body_port=port, radio_port=radio_port))

    def words(self, spec: RunSpec) -> list[str]:
        """Return how ArduPilot is started, and how much disk space raw measurements will take, in words."""
        flight, words = Flight.of(spec), []
        if flight.body_port:
            command = command_of_ardupilot(read_connection(flight.autopilot or ""), flight.body_port)
            words.append(f"ArduPilot, where it does not run yet, is started with: {command}")
        if flight.record == "sensors":
            words.append(sensors_words(Path(spec.out_dir)))
        return words

    # --- in the supervisor --------------------------------------------------------------------------------------------

    def launch_arguments(self, spec: RunSpec) -> Mapping[str, object]:
        """Return the arguments for the launch files of ``uav_bringup``."""
        flight, scenario = Flight.of(spec), load_scenario(spec.scenario)
        others = [fault for fault in spec.faults if parse_fault(fault).what in dict(scenario.faults)]
        radio = [fault for fault in others if parse_fault(fault).what not in dict(scenario.processes)]
        arguments: dict[str, object] = {
            # The autopilot that is followed has its own pace: a limit here would fall behind it.
            "rate": f"{0.0 if flight.sensors.startswith(FOLLOWED) else flight.rate:g}",
            "record": flight.record,
            "faults": ",".join(fault for fault in spec.faults if parse_fault(fault).what in FAULTS),
            "radio_faults": ",".join(radio),
            "radio_port": flight.radio_port,
            "mavlink_port": flight.mavlink_port,
            "ardupilot_port": flight.body_port,
            "imperfections": flight.imperfections,
        }
        if flight.autopilot is None:
            return arguments
        vehicle = {"": {"simulate": "false"}, "simulated": {"vehicle": "ardupilot"}}.get(flight.sensors, {"vehicle": flight.sensors})
        return {**arguments, **vehicle, "autopilot": flight.autopilot}

    def listen(self, spec: RunSpec, departed: Callable[[float], None]) -> None:  # noqa: ARG002
        """Subscribe to the simulator's lift-off, and to the guidance's state: whether heartbeats arrive, and who has the vehicle."""
        import rospy
        from std_msgs.msg import String
        from uav_msgs.msg import GuidanceState

        def look(message: Any) -> None:
            lift_off_s = json.loads(message.data).get("lift_off_s")
            if lift_off_s is not None:
                departed(lift_off_s)

        self._subscribers = [
            rospy.Subscriber("/sim/state", String, look, queue_size=5),
            rospy.Subscriber("/uav_guidance/state", GuidanceState, self._hear_guidance, queue_size=1),
        ]

    def _hear_guidance(self, state: Any) -> None:
        self._guidance = state
        self._linked = self._linked or state.link

    def clock_source(self, spec: RunSpec) -> str:
        """Return what publishes ``/clock``, in words."""
        flight = Flight.of(spec)
        if flight.autopilot is None:
            return "the simulator"
        if flight.sensors.startswith(FOLLOWED):
            return f"the autopilot that is followed, at {flight.sensors.removeprefix(FOLLOWED)}"
        return f"ArduPilot on UDP {flight.body_port}"

    def waits(self, spec: RunSpec, *, clock: bool) -> list[str]:
        """Return what has not arrived from a real autopilot, in words; empty where all has."""
        flight = Flight.of(spec)
        if flight.autopilot is None or self._linked:
            return []
        connection = read_connection(flight.autopilot)
        if connection.refused:
            return [f"the autopilot at {connection.text}: connection refused, nothing listens there"]
        if clock or not flight.simulated:
            return [f"the autopilot at {connection.text}: no heartbeat has come{' there' if connection.kind in LISTENS else ''}"]
        return []

    def held(self, clock: Clock) -> str:
        """Return in words that the pilot or a failsafe has the vehicle in the air, its mode and height; empty where they have not."""
        state = self._fresh(clock)
        if state is None or not state.link or state.authority or not state.armed or state.landed_state not in OFF_GROUND:
            return ""
        return f"the vehicle is to be landed, or given back by GUIDED: the pilot or a failsafe has it, {where(state)}"

    def bring_to_rest(self, clock: Clock) -> None:
        """Make the guidance land the vehicle, and wait until it stands, or somebody else has it."""
        if clock.now_s is None:
            return
        if self._landing is None:
            from uav_flight.landing import Landing  # late: it needs ROS

            self._landing = Landing(clock)
        self._landing.land()

    def resting(self, clock: Clock) -> str:
        """Return in words how the vehicle is that is being landed, and why the guidance does not land it, if it said so."""
        state = self._fresh(clock)
        if state is None:
            return "the vehicle is to be landed: nothing is heard of the guidance"
        if not state.armed:
            return ""
        how = where(state) if state.landed_state in OFF_GROUND else f"on the ground with its motors on, in {state.mode}"
        refused = "" if self._landing is None else self._landing.refused
        return f"the vehicle is being landed: {how}" + (f"; {refused}" if refused else "")

    def _fresh(self, clock: Clock) -> Any:
        """Return the guidance's last state; None where there is none, or the guidance has died or hangs."""
        if self._guidance is None or clock.now_s is None:
            return None
        if self._guidance is not self._seen[0]:
            self._seen = self._guidance, clock.now_s
        return None if clock.now_s - self._seen[1] > SILENT_S else self._guidance


def where(state: Any) -> str:
    """Return mode and height of a vehicle in the air, in words."""
    return f"in {state.mode}, at {state.position_enu_m.z:.1f} m"


def sensors_words(out: Path) -> str:
    """Return in words how much disk space the raw measurements will take, and how much is free, also before the folder exists."""
    free_gb, minutes_gb = shutil.disk_usage(folder_there(out)).free / 1e9, 120 * SENSORS_MB_S / 1e3
    return (
        f"functional.bag will hold raw measurements: about {SENSORS_MB_S:g} MB a second of flight, {minutes_gb:.1f} GB for two minutes; "
        f"{free_gb:.0f} GB are free, and the last one is left alone"
    )
