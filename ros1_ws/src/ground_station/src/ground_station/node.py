"""The node /ground_station: RTP in, pictures and reports out, and the telepilot's control link and stick.

It stands for another machine: of the drone it knows what the radio brings. Only the mission clock, and in a simulation the camera's
own pictures to compare with, come from elsewhere.
"""

from __future__ import annotations

import json
from pathlib import Path

import rospy
from geometry_msgs.msg import Twist
from radio_link.loop import MissionLoop
from sensor_msgs.msg import Image
from uav_msgs.srv import Command, CommandResponse
from video_stream.node import IMAGE_BYTES, pixels
from video_stream.recorder import Film
from video_stream.wire import NS, Seal, sdp

from ground_station.control import ControlLink
from ground_station.receiver import Picture, VideoReceiver
from ground_station.references import References
from ground_station.settings import GroundStationSettings
from ground_station.stick import Deflection
from perception_core.ros import read_settings
from resource_reporter import ToldService

VIDEO, TELEMETRY = 0, 1
"""The sockets: what the drone films, and what its autopilot says."""


class GroundStationNode:
    """Shows and records, measures, reports."""

    def __init__(self, settings: GroundStationSettings) -> None:
        self._settings = settings
        self._seal = Seal(settings.key.encode())
        self._references = References() if settings.reference else None
        self._receiver = VideoReceiver(self._seal, settings.width, settings.height, self._references)
        self._control = ControlLink()
        self._log = _ShownLog(Path(settings.video_path), settings) if settings.video_path else None
        self._screen = rospy.Publisher("~screen", Image, queue_size=1)
        self._refused = 0
        self._loop: MissionLoop[Twist] = MissionLoop(
            [settings.video_port, settings.telemetry_port], on_tick=self._on_tick, on_datagram=self._on_datagram, on_item=self._on_stick
        )
        self._stick = rospy.Subscriber("~stick", Twist, self._loop.post, queue_size=1, tcp_nodelay=True)
        self._give_back = ToldService("~give_back", Command, self._on_give_back)
        if self._references is not None:
            self._subscriber = rospy.Subscriber(
                settings.reference, Image, self._on_reference, self._references, buff_size=IMAGE_BYTES, tcp_nodelay=True
            )

    def run(self) -> None:
        """Run until ROS shuts down; the film is complete then."""
        self._loop.run()
        if self._log is not None:
            self._log.close()

    def _on_reference(self, message: Image, references: References) -> None:
        # By ROS's own thread: the loop waits for it.
        try:
            references.note(message.header.stamp.to_nsec(), pixels(message))
        except ValueError as error:
            rospy.logerr_throttle(5.0, f"{self._settings.reference}: {error}")

    def _on_stick(self, message: Twist) -> None:
        ahead, turn = message.linear, message.angular.z
        self._control.stick.move(Deflection(ahead.x, ahead.y, ahead.z, turn), self._loop.now_ns)

    def _on_give_back(self, _request: object) -> CommandResponse:
        reason = self._control.stick.give_back(self._loop.now_ns)
        return CommandResponse(accepted=not reason, reason=reason)

    def _on_datagram(self, source: int, data: bytes) -> None:
        if source == TELEMETRY:
            self._control.hear(data)
            return
        # A player believes whatever comes: it gets the drone's packets alone, each once.
        if self._receiver.datagram(data, self._loop.now_ns):
            self._loop.send(data, self._settings.player_port)

    def _on_tick(self) -> None:
        now_ns = self._loop.now_ns
        for picture in self._receiver.pictures(now_ns):
            self._show(picture)
        report = self._receiver.report(now_ns)
        if report is not None:
            self._loop.send(report.pack(self._seal), self._settings.report_port)
        for data in self._control.due(now_ns) if self._settings.heartbeat else ():
            self._loop.send(data, self._settings.control_port)
        self._tell_refused()

    def _show(self, picture: Picture) -> None:
        if self._log is not None:
            self._log.add(picture)
        if self._screen.get_num_connections():
            height, width = picture.image.shape[:2]
            message = Image(height=height, width=width, encoding="rgb8", step=3 * width, data=picture.image.tobytes())
            message.header.stamp = rospy.Time(*divmod(picture.stamp_ns, NS))
            self._screen.publish(message)

    def _tell_refused(self) -> None:
        if self._receiver.refused > self._refused:
            rospy.logwarn_throttle(5.0, f"{self._receiver.refused} datagrams were refused, the last one: {self._receiver.last_refusal}")
            self._refused = self._receiver.refused


class _ShownLog:
    """``received.mkv``: what the telepilot saw; ``shown.jsonl``: a line each; ``stream.sdp``: for any player."""

    def __init__(self, folder: Path, settings: GroundStationSettings) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "stream.sdp").write_text(sdp(settings.player_port), encoding="ascii", newline="")
        lives = sum(1 for _ in folder.glob("shown*.jsonl"))
        suffix = "" if not lives else f"-{lives + 1}"
        self._name = f"received{suffix}"
        self._folder, self._size = folder, (settings.width, settings.height)
        self._film: Film | None = None
        self._lines = (folder / f"shown{suffix}.jsonl").open("w", encoding="utf-8", buffering=1)

    def add(self, picture: Picture) -> None:
        """Note a picture that is shown."""
        if self._film is None:
            self._film = Film(self._folder / f"{self._name}.mkv", self._size)
        line = {
            "id": picture.frame_id,
            "sent_s": picture.stamp_ns / NS,
            "received_s": picture.received_ns / NS,
            "shown_s": picture.shown_ns / NS,
            "ssim": None if picture.ssim is None else round(picture.ssim, 5),
            "index": self._film.add(picture.image, picture.shown_ns),
            "film": self._name,
        }
        self._lines.write(json.dumps(line) + "\n")

    def close(self) -> None:
        if self._film is not None:
            self._film.close()
        self._lines.close()


def main() -> None:
    """Run the node until ROS shuts down."""
    rospy.init_node("ground_station")
    GroundStationNode(read_settings(GroundStationSettings())).run()
