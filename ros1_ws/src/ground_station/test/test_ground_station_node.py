"""Drone, radio and ground station as nodes on a live graph: every UDP port under attack, and a foreign player that watches."""

from __future__ import annotations

import json
import random
import select
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
import rospy
from geometry_msgs.msg import Twist, Vector3
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from radio_link.loop import LARGEST_DATAGRAM, udp_socket
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image
from std_msgs.msg import Header
from uav_msgs.msg import VideoState
from uav_msgs.srv import Command, Stream
from video_stream.wire import NS, Seal, VideoPacket

from alula.common.network import free_port
from alula_testing.waits import HANGS_S, until

SOURCES = Path(__file__).parents[2]
WIDTH, HEIGHT = 320, 180
TICK_NS, FRAME_NS = NS // 50, NS // 20
SHOWN = 40
HEARD = 5
PLAYED = 10
RESTS, HOLDS = 5, 100  # messages of a stick, at most 50 a second
KEY = "a secret of this test"
NODES = RADIO, STREAM, GROUND = "radio_link", "video_stream", "ground_station"


def scenery() -> np.ndarray:
    rng = np.random.default_rng(3)
    return cv2.resize(rng.integers(0, 255, (20, 200, 3), dtype=np.uint8), (4 * WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC)


class Tamperer:
    """Stands between a sender and the radio: passes everything on, in disorder, with what it has heard before and with noise."""

    def __init__(self, to: int, others: tuple[int, ...]) -> None:
        self.port = free_port()
        self.heard: list[bytes] = []
        self._to, self._others = to, others
        self._chance = random.Random(9)  # noqa: S311 - no secret
        self._socket = udp_socket(self.port)

    def close(self) -> None:
        self._socket.close()

    def pass_on(self) -> None:
        """Pass on all that has come, three datagrams at a time."""
        while came := [data for data in (self._next() for _ in range(3)) if data is not None]:
            self._pass_on(came)

    def _next(self) -> bytes | None:
        return self._socket.recv(LARGEST_DATAGRAM) if select.select([self._socket], [], [], 0.0)[0] else None

    def _pass_on(self, came: list[bytes]) -> None:
        self.heard += came
        chance = self._chance
        forged = bytearray(chance.choice(came) or b"\0")  # an empty datagram may have come, too
        forged[chance.randrange(len(forged))] ^= 1 << chance.randrange(8)
        mixed = [*came, bytes(forged), chance.randbytes(chance.randrange(1500)), b"", *chance.choices(self.heard, k=2)]
        chance.shuffle(mixed)
        for data in mixed:
            self._socket.sendto(data, ("127.0.0.1", self._to))
        # The same rubbish, and what is right in another place, into the ports that only the radio should use.
        for port in self._others:
            for data in (bytes(forged), chance.randbytes(40), chance.choice(self.heard)):
                self._socket.sendto(data, ("127.0.0.1", port))


class Flight:
    """The mission clock and a camera; after each tick the nodes have worked."""

    def __init__(self, done: dict[str, int], tamperers: Sequence[Tamperer]) -> None:
        self.now_ns = 10 * NS
        self.filmed = 0
        self.alive = set(NODES)
        self._done = done
        self._tamperers = tamperers
        self._scenery = scenery()
        self._clock = rospy.Publisher("/clock", Clock, queue_size=10)
        self._camera = rospy.Publisher("/camera/image_raw", Image, queue_size=10)

    def connected(self) -> bool:
        """Let time pass, and tell whether every node hears and is heard."""
        self._pass()
        return len(self._done) == len(NODES) and self._clock.get_num_connections() >= 3 and self._camera.get_num_connections() >= 2

    def _pass(self) -> None:
        # Within the tick in which it was sent: the way through a tamperer takes no mission clock, however slow the machine is.
        for tamperer in self._tamperers:
            tamperer.pass_on()
        self.now_ns += TICK_NS
        self._clock.publish(Clock(rospy.Time(*divmod(self.now_ns, NS))))

    def tick(self) -> None:
        """Let time pass until all nodes have followed; film when a picture is due."""
        if (self.now_ns + TICK_NS) % FRAME_NS < TICK_NS:
            x = 5 * self.filmed % (3 * WIDTH)
            pixels = np.ascontiguousarray(self._scenery[:, x : x + WIDTH])
            image = Image(height=HEIGHT, width=WIDTH, encoding="rgb8", step=3 * WIDTH, data=pixels.tobytes())
            image.header.stamp = rospy.Time(*divmod(self.now_ns + TICK_NS, NS))
            self._camera.publish(image)
            self.filmed += 1
        self._pass()
        followed = lambda: all(self._done.get(name, 0) >= self.now_ns for name in self.alive)  # noqa: E731
        until(followed, what="the nodes follow the clock")

    def until(self, condition: Callable[[], object], limit_s: float) -> float:
        """Let time pass until the condition holds; return how long that took, in seconds of mission clock."""
        begun_ns = self.now_ns
        while not condition():
            assert self.now_ns - begun_ns < limit_s * NS, f"not within {limit_s} s of mission clock"
            self.tick()
        return (self.now_ns - begun_ns) / NS

    def back(self, name: str) -> None:
        """Wait for a node that was started again."""
        until(lambda: self._pass() or self._done.get(name, 0) > self.now_ns - NS, what=f"{name} is back")
        self.alive.add(name)


class Player(threading.Thread):
    """A foreign player: opens the session description and decodes what comes."""

    def __init__(self, session: Path) -> None:
        super().__init__(daemon=True)
        self.pictures: list[np.ndarray] = []
        self.error = ""
        self._session = session

    def run(self) -> None:
        try:
            options = {"protocol_whitelist": "file,rtp,udp", "analyzeduration": "100000", "probesize": "20000"}
            with av.open(str(self._session), format="sdp", options=options, timeout=HANGS_S) as stream:
                for frame in stream.decode(video=0):
                    self.pictures.append(frame.to_ndarray(format="rgb24"))
                    if len(self.pictures) >= PLAYED:
                        return
        except av.FFmpegError as error:
            self.error = str(error)


@pytest.fixture
def stage(ros_master, start_node, tmp_path):
    """Start the nodes with a tamperer on both ways; yield flight, processes and tamperers."""
    rospy.set_param("/use_sim_time", True)
    base = next(port for port in iter(free_port, None) if port < 60_000)
    video = Tamperer(base, (base + 1, base + 2, base + 3, base + 4, base + 5, base + 8))
    report = Tamperer(base + 2, (base, base + 3))
    done: dict[str, int] = {}
    note = lambda header, name: done.update({name: header.stamp.to_nsec()})  # noqa: E731
    subscribers = [rospy.Subscriber(f"/{name}/done", Header, note, name) for name in NODES]
    parameters = {
        RADIO: [f"_base_port:={base}"],
        STREAM: [f"_video_port:={video.port}", f"_report_port:={base + 3}", f"_key:={KEY}"],
        GROUND: [f"_video_port:={base + 1}", f"_report_port:={report.port}", f"_control_port:={base + 4}", f"_player_port:={base + 6}"],
    }
    parameters[GROUND] += [
        f"_telemetry_port:={base + 8}",
        f"_key:={KEY}",
        "_reference:=/camera/image_raw",
        f"_width:={WIDTH}",
        f"_height:={HEIGHT}",
    ]
    parameters[GROUND] += [f"_video_path:={tmp_path}"]
    nodes = {name: start_node([str(SOURCES / name / f"scripts/{name}_node"), *words]) for name, words in parameters.items()}
    flight = Flight(done, (video, report))
    until(flight.connected, what="the nodes are up")

    def kill(name: str) -> Callable[[], None]:
        """Kill a node; return what starts it again."""
        flight.alive.remove(name)
        nodes[name].kill()
        nodes[name].wait()
        return lambda: nodes.update({name: start_node([str(SOURCES / name / f"scripts/{name}_node"), *parameters[name]])})

    yield flight, nodes, video, kill
    for topic in (*subscribers, flight._clock, flight._camera):
        topic.unregister()
    for tamperer in (video, report):
        tamperer.close()
    rospy.set_param("/use_sim_time", False)


def test_garbage_replays_and_disorder_in_every_port_show_no_wrong_picture_and_a_foreign_player_watches(stage, tmp_path):
    flight, nodes, video, _ = stage
    player = Player(tmp_path / "stream.sdp")
    player.start()
    rospy.wait_for_service("/video_stream/stream", HANGS_S)
    assert rospy.ServiceProxy("/video_stream/stream", Stream)(True, 5.0, 0.3, 5.0).accepted
    end_s = time.monotonic() + HANGS_S
    log = tmp_path / "shown.jsonl"
    while (player.is_alive() or log.read_text().count("\n") < SHOWN) and time.monotonic() < end_s:
        flight.tick()
    assert {name: node.poll() for name, node in nodes.items()} == dict.fromkeys(nodes), "all nodes live"
    shown = [json.loads(line) for line in log.read_text().splitlines()]
    assert [line["id"] for line in shown] == sorted({line["id"] for line in shown}), "each frame once, in order"
    assert len(shown) >= SHOWN
    compared = [line["ssim"] for line in shown]
    assert None not in compared, "the reference comes another way, and is waited for"
    assert min(compared) > 0.5
    sent = {VideoPacket.parse(data, Seal(KEY.encode())).mark.frame_id for data in video.heard}
    assert {line["id"] for line in shown} <= sent
    assert (player.error, len(player.pictures)) == ("", PLAYED)
    assert {picture.shape for picture in player.pictures} == {(HEIGHT, WIDTH, 3)}


class Telepilot:
    """What the drone knows of what the telepilot sees, and the service that begins the stream."""

    def __init__(self) -> None:
        self.state = VideoState()
        self._subscriber = rospy.Subscriber("/video_stream/state", VideoState, self._on_state)

    def _on_state(self, message: VideoState) -> None:
        self.state = message

    def begin(self) -> None:
        rospy.wait_for_service("/video_stream/stream", HANGS_S)
        assert rospy.ServiceProxy("/video_stream/stream", Stream)(True, 5.0, 0.3, 2.0).accepted

    def sees(self) -> bool:
        return self.state.streaming and self.state.fps >= 5.0

    def close(self) -> None:
        self._subscriber.unregister()


@pytest.fixture
def telepilot(stage):
    made = Telepilot()
    yield made
    made.close()


def test_an_encoder_that_was_killed_says_so_when_it_is_back_and_shows_pictures_again_once_told_to(stage, telepilot, tmp_path):
    flight, nodes, _, kill = stage
    telepilot.begin()
    flight.until(telepilot.sees, 10.0)
    start_again = kill(STREAM)
    died_ns = flight.now_ns
    for _tick in range(50):
        flight.tick()
    assert telepilot.state.header.stamp.to_nsec() <= died_ns + TICK_NS, "nothing tells of the picture: the skill watches that"
    assert nodes[GROUND].poll() is None
    assert nodes[RADIO].poll() is None
    start_again()
    flight.back(STREAM)
    flight.until(lambda: telepilot.state.header.stamp.to_nsec() > died_ns + NS, 5.0)
    assert not telepilot.state.streaming, "it was told nothing yet"
    shown = len((tmp_path / "shown.jsonl").read_text().splitlines())
    telepilot.begin()
    assert flight.until(telepilot.sees, 10.0) < 5.0
    lines = [json.loads(line) for line in (tmp_path / "shown.jsonl").read_text().splitlines()]
    assert lines[shown]["id"] < lines[shown - 1]["id"], "its frames count from 0 again, and are shown all the same"


def test_a_ground_station_that_was_killed_leaves_the_drone_with_no_picture_and_the_next_one_sees_again(stage, telepilot):
    flight, nodes, _, kill = stage
    telepilot.begin()
    flight.until(telepilot.sees, 10.0)
    start_again = kill(GROUND)
    assert flight.until(lambda: telepilot.state.fps == 0.0, 3.0) >= 1.0, "a report that is late is not a ground station that is dead"
    took_s = flight.until(lambda: telepilot.state.fps_margin < 0.0, 8.0)
    assert telepilot.state.exhausted
    assert took_s > 0.5, "adaptation first"
    assert nodes[STREAM].poll() is None
    start_again()
    flight.back(GROUND)
    assert flight.until(telepilot.sees, 15.0) < 10.0
    assert telepilot.state.fps_margin >= 0.0


class FakeAutopilot:
    """The vehicle's end of the control link: says in which mode it is, and takes the one that it is told."""

    def __init__(self, telemetry_port: int) -> None:
        self.mode = 4
        self.sticks: list[int] = []
        self._socket = udp_socket(0)
        self._to = telemetry_port
        self._sender = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        self._parser = mavlink.MAVLink(None)

    @property
    def port(self) -> int:
        return self._socket.getsockname()[1]

    def work(self) -> None:
        """Take what has come, and tell the mode."""
        for message in self._heard():
            if message.get_type() == "MANUAL_CONTROL":
                self.sticks.append(message.x)
            elif message.get_type() == "COMMAND_LONG":
                self.mode = round(message.param2)
        beat = mavlink.MAVLink_heartbeat_message(13, 3, 1, self.mode, 4, 3)
        self._socket.sendto(bytes(beat.pack(self._sender)), ("127.0.0.1", self._to))

    def _heard(self) -> list[mavlink.MAVLink_message]:
        data = b""
        while select.select([self._socket], [], [], 0.02)[0]:
            data += self._socket.recv(LARGEST_DATAGRAM)
        return self._parser.parse_buffer(data) or []

    def close(self) -> None:
        self._socket.close()


def test_the_stick_s_topic_takes_the_vehicle_over_and_the_service_gives_it_back(ros_master, start_node):
    telemetry = free_port()
    autopilot = FakeAutopilot(telemetry)
    ports = [f"_control_port:={autopilot.port}", f"_telemetry_port:={telemetry}", "_video_port:=0", "_player_port:=1", "_report_port:=1"]
    start_node([str(SOURCES / GROUND / f"scripts/{GROUND}_node"), *ports])
    stick = rospy.Publisher("/ground_station/stick", Twist, queue_size=1)
    until(stick.get_num_connections, what="the ground station hears the stick")
    give_back = rospy.ServiceProxy("/ground_station/give_back", Command)
    give_back.wait_for_service(HANGS_S)
    assert give_back().reason == "the telepilot does not have the vehicle"

    def flown(forward: float, condition: Callable[[], bool]) -> None:
        """Hold the stick; where nothing follows, rest and push again, as a person does: of positions only the newest is heard."""

        def follows() -> bool:
            for position in [0.0] * RESTS + [forward] * HOLDS:
                stick.publish(Twist(linear=Vector3(x=position)))
                autopilot.work()
                if condition():
                    return True
            return False

        until(follows, what=f"the stick at {forward}")

    flown(0.5, lambda: 500 in autopilot.sticks)
    assert autopilot.mode == 5
    until(lambda: autopilot.work() or autopilot.sticks[-1] == 0, what="a stick that says nothing is centred")
    assert give_back().accepted
    flown(0.0, lambda: autopilot.mode == 4)
    autopilot.close()


def test_an_encoder_is_heard_of_while_simulated_time_stands_and_tells_nothing_new(stage, telepilot):
    flight, *_ = stage
    telepilot.begin()
    flight.until(telepilot.sees, 10.0)
    heard: list[VideoState] = []
    subscriber = rospy.Subscriber("/video_stream/state", VideoState, heard.append)
    until(lambda: len(heard) > HEARD, what="it is heard of by the monotonic clock")
    assert len({one.header.stamp for one in heard[2:]}) == 1, "the first ones may be of ticks that were under way"
    assert all(one.streaming for one in heard)
    subscriber.unregister()
