"""The node /radio_link: carries datagrams between drone and ground as the emulated radio lets them through."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TextIO

import rospy
from geometry_msgs.msg import PoseStamped
from std_msgs.msg import String
from uav_msgs.msg import GuidanceState

from alula.common.faults import FaultError, parse_faults
from perception_core.ros import read_settings
from radio_link.conditions import Quality
from radio_link.laws import LAWS, LinkBudget, Point, condition_by_law
from radio_link.loop import NS, MissionLoop
from radio_link.radio import FAULTS, Place, Radio, Situation, by_zones
from radio_link.settings import RadioSettings
from radio_link.vehicle import RadioCarrier
from uav_simulator.errors import ConfigError
from uav_simulator.world.config import WorldConfig, load_world

VIDEO, REPORT, CONTROL, TELEMETRY = 0, 1, 2, 3
"""The flows, in the order of the sockets that take them; telemetry is what the autopilot answers to the control link."""
STATE_PERIOD_NS = NS // 2


def make_place(settings: RadioSettings) -> Place:
    """Return a function from a place to the quality of the radio; raises ConfigError."""
    world = load_world(Path(settings.world)) if settings.world else None
    if settings.law == "zones":
        return by_zones(() if world is None else world.radio_zones)
    if settings.law not in LAWS:
        raise ConfigError(f"parameter ~law: there is no law '{settings.law}'; choose one of zones, {', '.join(LAWS)}")
    return _by_law(settings, world)


def _by_law(settings: RadioSettings, world: WorldConfig | None) -> Place:
    law, budget = LAWS[settings.law], LinkBudget()
    station = (settings.station_east_m, settings.station_north_m, settings.station_height_m)
    boxes = [] if world is None else [(box.low, box.high) for box in world.boxes]

    def look(point: Point | None) -> Situation:
        both = condition_by_law(law, station, point or station, boxes, budget)
        quality = next(q for q in Quality if both.down.rate_bps >= _least_bps(q))
        return Situation(both, quality, settings.law)

    return look


def _least_bps(quality: Quality) -> float:
    return {Quality.GOOD: 2.5e6, Quality.DEGRADED: 300e3, Quality.CRITICAL: 1.0, Quality.OUT: 0.0}[quality]


class RadioLinkNode:
    """Wires the radio to sockets, the mission clock, and what simulator or guidance know of the vehicle."""

    def __init__(self, settings: RadioSettings) -> None:
        base = settings.base_port
        self._to = {VIDEO: base + 1, REPORT: base + 3, CONTROL: settings.control_to or base + 5, TELEMETRY: base + 8}
        self._radio = Radio(make_place(settings), parse_faults(settings.faults, FAULTS), seed=settings.seed)
        self._vehicle = RadioCarrier()
        self._told: tuple[Situation, bool] | None = None
        self._state_due_ns = 0
        self._log = _open_log(Path(settings.log_path)) if settings.log_path else None
        self._state = rospy.Publisher("~state", String, queue_size=5, latch=True)
        self._pose = rospy.Subscriber("/sim/true_pose", PoseStamped, self._on_pose, queue_size=1)
        self._simulator = rospy.Subscriber("/sim/state", String, self._on_simulator, queue_size=5)
        self._guidance = rospy.Subscriber("/uav_guidance/state", GuidanceState, self._on_guidance, queue_size=1)
        self._loop: MissionLoop[None] = MissionLoop(
            [base, base + 2, base + 4, 0],
            on_tick=self._on_tick,
            on_datagram=self._on_datagram,
        )

    def run(self) -> None:
        """Run until ROS shuts down."""
        self._loop.run()

    def _on_pose(self, message: PoseStamped) -> None:
        p = message.pose.position
        self._vehicle.simulated_at((p.x, p.y, p.z))

    def _on_simulator(self, message: String) -> None:
        self._vehicle.simulated_lift_off(json.loads(message.data).get("lift_off_s"))

    def _on_guidance(self, message: GuidanceState) -> None:
        p = message.position_enu_m
        self._vehicle.guided((p.x, p.y, p.z), message.landed_state, message.header.stamp.to_sec())

    def _on_datagram(self, flow: int, data: bytes) -> None:
        if flow in {CONTROL, TELEMETRY} and self._radio.control_lost:
            return
        channel = self._radio.down if flow in {VIDEO, TELEMETRY} else self._radio.up
        channel.send(bytes([flow]) + data, self._loop.now_ns)

    def _on_tick(self) -> None:
        now_ns = self._loop.now_ns
        lift_off_s = self._vehicle.lift_off_s
        self._radio.look(self._vehicle.point, None if lift_off_s is None else now_ns / NS - lift_off_s)
        for channel in (self._radio.down, self._radio.up):
            for data in channel.due(now_ns):
                self._deliver(data)
        self._tell(now_ns)

    def _deliver(self, data: bytes) -> None:
        """Hand over what has crossed the radio; its first byte names the flow."""
        self._loop.send(data[1:], self._to[data[0]], by=TELEMETRY if data[0] == CONTROL else VIDEO)

    def _tell(self, now_ns: int) -> None:
        """Publish the state twice a second and when it changes; log the changes."""
        present = self._radio.situation, self._radio.control_lost
        changed = present != self._told
        if not changed and now_ns < self._state_due_ns:
            return
        self._state_due_ns = now_ns + STATE_PERIOD_NS
        self._told = present
        text = json.dumps(describe(self._radio, now_ns))
        self._state.publish(String(text))
        if changed and self._log is not None:
            self._log.write(text + "\n")


def _open_log(path: Path) -> TextIO:
    path.parent.mkdir(parents=True, exist_ok=True)
    return path.open("a", encoding="utf-8", buffering=1)


def describe(radio: Radio, now_ns: int) -> dict[str, object]:
    """Return the radio's state for people and reports."""
    situation, counts = radio.situation, {}
    for name, channel in (("down", radio.down), ("up", radio.up)):
        counts[name] = {"sent": channel.sent, "delivered": channel.delivered, "lost": channel.lost, "dropped": channel.dropped}
    return {
        "t_s": round(now_ns / NS, 3),
        "quality": situation.quality.value,
        "cause": situation.cause,
        "down_bps": round(situation.both.down.rate_bps),
        "up_bps": round(situation.both.up.rate_bps),
        "control_lost": radio.control_lost,
        **counts,
    }


def main() -> None:
    """Run the node until ROS shuts down; a wrong parameter ends it with one line."""
    rospy.init_node("radio_link")
    try:
        RadioLinkNode(read_settings(RadioSettings())).run()
    except (ConfigError, FaultError, ValueError, OSError) as error:
        rospy.logfatal(str(error))
        raise SystemExit(2) from error
