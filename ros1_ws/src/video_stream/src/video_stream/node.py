"""The node /video_stream: camera in, RTP out, reports in; publishes how the telepilot sees, for the skills."""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import rospy
from radio_link.loop import MissionLoop
from sensor_msgs.msg import Image
from std_msgs.msg import Header
from uav_msgs.msg import VideoState
from uav_msgs.srv import Stream, StreamResponse

from perception_core.ros import read_settings
from resource_reporter import ResourceReporter, ToldService
from video_stream.camera import CameraError, CameraSource, CameraThread
from video_stream.criteria import Criteria, Margins, Watch
from video_stream.encoder import Rgb
from video_stream.levels import Level
from video_stream.rate import RateSettings
from video_stream.recorder import Film
from video_stream.sender import SentFrame, VideoSender
from video_stream.settings import StreamSettings
from video_stream.wire import NS, Seal, WireError

if TYPE_CHECKING:
    from uav_msgs.srv import StreamRequest

STATE_PERIOD_NS = NS // 5
LINK_TIMEOUT_NS = NS  # without a report: nothing is known of what the telepilot sees
IMAGE_BYTES = 1 << 23
RED_FIRST = {"rgb8": True, "bgr8": False}


def pixels(message: Image) -> Rgb:
    """Return the image (H, W, 3) uint8 RGB; raise ValueError for an encoding that is not known."""
    if message.encoding not in RED_FIRST:
        raise ValueError(f"images are {message.encoding}; {' or '.join(RED_FIRST)} is needed")
    rows = np.frombuffer(message.data, dtype=np.uint8).reshape(message.height, message.step)
    image = rows[:, : 3 * message.width].reshape(message.height, message.width, 3)
    return np.ascontiguousarray(image if RED_FIRST[message.encoding] else image[..., ::-1])


@dataclass(frozen=True)
class Picture:
    """A picture of a camera that is read here, (H, W, 3) uint8 RGB, and when it came."""

    image: Rgb
    stamp_ns: int


class VideoStreamNode:
    """Sends while it is enabled; listens always."""

    def __init__(self, settings: StreamSettings) -> None:
        self._settings = settings
        self._sender = self._fresh_sender()
        self._watch: Watch | None = Watch(Criteria(), 0) if settings.enabled else None
        self._link = ""
        self._state_due_ns = 0
        self._told: VideoState | None = None
        self._told_s = 0.0  # monotonic clock
        self._log = _SentLog(Path(settings.video_path)) if settings.video_path else None
        self._reporter = ResourceReporter("video")
        self._state = rospy.Publisher("~state", VideoState, queue_size=5)
        self._camera = self._opened_camera(settings) if settings.source else None
        self._waiting = False
        self._failure = ""
        self._loop: MissionLoop[Image | Picture] = MissionLoop(
            [settings.report_port],
            on_tick=self._on_tick,
            on_datagram=self._on_report,
            on_item=self._on_item,
            on_look=self._on_look,
            reporters=[self._reporter],
        )
        self._service = ToldService("~stream", Stream, self._on_stream)
        if self._camera is None:
            self._subscriber = rospy.Subscriber(
                settings.image, Image, self._loop.post, queue_size=2, buff_size=IMAGE_BYTES, tcp_nodelay=True
            )

    def run(self) -> None:
        """Run until ROS shuts down, or the camera gives no more pictures (then CameraError); the film is complete then."""
        if self._camera is not None:
            self._camera.start()
        self._loop.run()
        if self._camera is not None:
            self._camera.close()
        if self._log is not None:
            self._log.close()
        if self._failure:
            raise CameraError(self._failure)

    def _opened_camera(self, settings: StreamSettings) -> CameraThread:
        source = CameraSource(name=settings.source, width=settings.source_width, height=settings.source_height, fps=settings.source_fps)
        return CameraThread(source, self._on_picture, now_s=rospy.get_time, ended=self._on_camera_end)

    def _on_camera_end(self, reason: str) -> None:
        self._failure = reason
        rospy.signal_shutdown(reason)

    def _fresh_sender(self) -> VideoSender:
        limits = replace(RateSettings(), max_bps=self._settings.max_bps, min_bps=self._settings.min_bps)
        return VideoSender(Seal(self._settings.key.encode()), limits)

    def _on_stream(self, request: StreamRequest) -> StreamResponse:
        """Begin to send, with these criteria, or stop."""
        if not request.on:
            self._watch = None
            return StreamResponse(accepted=True)
        criteria = Criteria(min_fps=request.min_fps, min_quality=request.min_quality, patience_s=request.patience_s)
        problem = criteria.problem()
        if not problem:
            self._watch = Watch(criteria, self._loop.now_ns)
        return StreamResponse(accepted=not problem, reason=problem)

    def _on_picture(self, image: Rgb) -> None:
        """Hand a picture of the camera's thread to the loop, unless one waits there already."""
        if not self._waiting:
            self._waiting = True
            self._loop.post(Picture(image, rospy.Time.now().to_nsec()))

    def _on_item(self, item: Image | Picture) -> None:
        self._waiting = False
        if self._watch is None:
            return
        try:
            picture = item if isinstance(item, Picture) else Picture(pixels(item), item.header.stamp.to_nsec())
        except ValueError as error:
            rospy.logerr_throttle(5.0, f"{self._settings.image}: {error}")
            return
        self._send(picture.image, picture.stamp_ns)

    def _send(self, image: Rgb, stamp_ns: int) -> None:
        frame = self._sender.frame(image, stamp_ns, max(self._loop.now_ns, stamp_ns))
        if frame is None:
            return
        for data in frame.datagrams:
            self._loop.send(data, self._settings.video_port)
        if self._log is not None:
            self._log.add(frame, image, self._sender)

    def _on_report(self, _socket: int, data: bytes) -> None:
        try:
            again = self._sender.feedback(data, self._loop.now_ns)
        except WireError as error:
            rospy.logwarn_throttle(5.0, f"refused on the report port: {error}")
            return
        for each in again:
            self._loop.send(each, self._settings.video_port)

    def _on_tick(self) -> None:
        now_ns = self._loop.now_ns
        heard_ns = self._sender.heard_ns
        up = heard_ns is not None and now_ns - heard_ns < LINK_TIMEOUT_NS
        self._tell_link("UP" if up else "DOWN" if heard_ns is not None else "")
        if now_ns >= self._state_due_ns:
            self._state_due_ns = now_ns + STATE_PERIOD_NS
            self._publish_state(now_ns, up=up)

    def _on_look(self) -> None:
        """Tell the last state again where simulated time creeps or stands: that the encoder is alive, as a reporter's heartbeat does.

        What is new in a state, and when by the mission clock, is not changed by how slow the machine is.
        """
        if self._told is not None and time.monotonic() - self._told_s >= STATE_PERIOD_NS / NS:
            self._tell(self._told)

    def _tell(self, message: VideoState) -> None:
        self._told, self._told_s = message, time.monotonic()
        self._state.publish(message)

    def _tell_link(self, state: str) -> None:
        if state and state != self._link:
            self._link = state
            self._reporter.report("link", state, "" if state == "UP" else "the ground station has not been heard for 1 s")

    def _publish_state(self, now_ns: int, *, up: bool) -> None:
        report, watch, sender = self._sender.report, self._watch, self._sender
        message = VideoState(header=Header(stamp=rospy.Time(*divmod(now_ns, NS))), streaming=watch is not None)
        # A picture that the ground station does not confirm was not seen.
        message.fps = report.fps if report is not None and up else 0.0
        message.quality = report.quality if report is not None else 0.0
        if report is not None:
            message.delay_s, message.loss, message.received_bps = report.delay_s, report.loss, report.received_bps
        margins = Margins(0.0, 0.0)
        if watch is not None:
            margins = watch.look(fps=message.fps, quality=message.quality, exhausted=sender.exhausted, now_ns=now_ns)
        message.fps_margin, message.quality_margin = margins.fps, margins.quality
        message.bit_rate_bps, message.exhausted, message.adaptations = sender.target_bps, sender.exhausted, sender.adaptations
        message.level = describe_level(sender.level)
        self._tell(message)


def describe_level(level: Level | None) -> str:
    """Return a level in words, as ``0.75 of the size, 20 fps``."""
    return "" if level is None else f"{level.scale:g} of the size, {level.fps:g} fps"


class _SentLog:
    """``sent.mkv``: what was given to the encoder; ``sent.jsonl``: a line each."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder
        self._film: Film | None = None
        # Restarted after a crash, it goes on in files of its own: a film can't be continued.
        lives = sum(1 for _ in folder.glob("sent*.jsonl"))
        self._name = "sent" if not lives else f"sent-{lives + 1}"
        self._lines = (folder / f"{self._name}.jsonl").open("w", encoding="utf-8", buffering=1)

    def add(self, frame: SentFrame, image: Rgb, sender: VideoSender) -> None:
        """Note a frame that was sent."""
        if self._film is None:
            self._film = Film(self._folder / f"{self._name}.mkv", (image.shape[1], image.shape[0]))
        index = self._film.add(image, frame.stamp_ns)
        line = {"id": frame.frame_id, "sent_s": frame.stamp_ns / NS, "bytes": frame.size_bytes, "key": frame.key, "index": index}
        level = None if sender.level is None else asdict(sender.level)
        self._lines.write(json.dumps({**line, "target_bps": round(sender.target_bps), "level": level, "film": self._name}) + "\n")

    def close(self) -> None:
        if self._film is not None:
            self._film.close()
        self._lines.close()


def main() -> None:
    """Run the node until ROS shuts down; a camera that can't be opened or ends ends it with one line."""
    rospy.init_node("video_stream")
    try:
        VideoStreamNode(read_settings(StreamSettings())).run()
    except CameraError as error:
        rospy.logfatal(str(error))
        raise SystemExit(2) from error
