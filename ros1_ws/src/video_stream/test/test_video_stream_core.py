"""The drone's end of the video without ROS: what crosses the radio, how the bit rate is found, when a criterion is missed."""

from __future__ import annotations

import dataclasses
import random

import av
import numpy as np
import pytest
from aiortc.codecs.h264 import h264_depayload
from hypothesis import given, settings
from hypothesis import strategies as st
from video_stream.criteria import Criteria, Watch
from video_stream.encoder import Encoder
from video_stream.levels import LADDER, level_for
from video_stream.rate import RateController, RateSettings
from video_stream.recorder import Film
from video_stream.report import VideoReport
from video_stream.sender import VideoSender
from video_stream.wire import NS, TAG_BYTES, Mark, Seal, VideoPacket, WireError, sdp

SEAL = Seal(b"a key")
STEP_NS = NS // 20


def picture(number: int, width: int = 320, height: int = 180) -> np.ndarray:
    rng = np.random.default_rng(7)
    return np.roll(rng.integers(0, 255, (height, width, 3), dtype=np.uint8), 3 * number, axis=1)


# --- wire ---------------------------------------------------------------------------------------------------------------

PACKET = VideoPacket(7, Mark(41, 123_456_789_000, 2, 5, key=True), b"\x65payload", held_ms=260)


def test_a_packet_in_bytes():
    data = PACKET.serialize(SEAL)
    assert data[0] == 0x90, "version 2, with extension"
    assert data[1] == 96, "no marker: not the last packet of the frame; payload type 96"
    assert data[2:4] == (7).to_bytes(2, "big"), "sequence number"
    assert int.from_bytes(data[4:8], "big") == 123_456_789_000 * 90_000 // NS, "time stamp, 90 kHz"
    assert data[12:14] == b"\xbe\xde", "one-byte header elements, RFC 8285"
    assert data[16] == (1 << 4) | 15, "element 1 of 16 bytes: the frame mark"
    assert data[-8:] == b"\x65payload"
    assert VideoPacket.parse(data, SEAL) == PACKET


@settings(max_examples=300)
@given(st.binary(max_size=200))
def test_garbage_is_refused(data: bytes):
    with pytest.raises(WireError):
        VideoPacket.parse(data, SEAL)
    with pytest.raises(WireError):
        VideoReport.parse(data, SEAL)


@settings(max_examples=300)
@given(st.integers(0, 10_000), st.integers(1, 255))
def test_a_single_changed_byte_is_found_out(place: int, change: int):
    """Of what matters: SSRC, payload type and version are not ours to judge."""
    data = bytearray(PACKET.serialize(SEAL))
    place %= len(data)
    data[place] ^= change
    try:
        found = VideoPacket.parse(bytes(data), SEAL)
    except WireError:
        return
    assert found == PACKET


def test_another_key_makes_no_packet_of_ours():
    with pytest.raises(WireError, match="tag"):
        VideoPacket.parse(PACKET.serialize(Seal(b"another")), SEAL)
    with pytest.raises(WireError, match="tag"):
        VideoReport.parse(VideoReport(1, 2).pack(Seal(b"another")), SEAL)


def test_a_report_comes_back_as_it_was():
    report = VideoReport(3, 5 * NS, newest_id=9, fps=20.0, quality=0.91, missing=((8, 0), (9, 3)), want_key=True)
    data = report.pack(SEAL)
    assert VideoReport.parse(data, SEAL) == report
    assert len(data) < TAG_BYTES + 120, "small enough for a narrow way up"


def test_the_session_description_names_port_and_codec():
    text = sdp(5004)
    assert "m=video 5004 RTP/AVP 96" in text
    assert "a=rtpmap:96 H264/90000" in text


# --- levels and rate ----------------------------------------------------------------------------------------------------


def test_levels_follow_the_rate_with_some_reluctance():
    assert level_for(2e6) is LADDER[0]
    assert level_for(100e3) is LADDER[-1]
    assert level_for(660e3, LADDER[1]) is LADDER[1], "not yet a tenth above the border"
    assert level_for(660e3, LADDER[0]) is LADDER[0]
    assert LADDER[1].size(640, 360) == (480, 270)


def drive(control: RateController, seconds: float, **report: float) -> float:
    """Have reports come for a while; return the time that follows."""
    begun = getattr(control, "clock", 0)
    for step in range(int(seconds * 20)):
        now_ns = begun + step * STEP_NS
        control.on_report(VideoReport(step + 1, now_ns, **{"received_bps": control.target_bps, **report}), now_ns)
        control.on_time(now_ns)
    control.clock = begun + int(seconds * 20) * STEP_NS
    return control.clock


def test_an_empty_queue_lets_the_rate_rise_to_the_most():
    control = RateController()
    drive(control, 5.0)
    assert control.target_bps == RateSettings().max_bps


def test_a_growing_queue_brings_it_below_what_arrives():
    control = RateController()
    drive(control, 1.5, queue_s=0.5, received_bps=400e3)
    assert control.target_bps <= 400e3
    assert not control.exhausted


def test_what_can_not_be_held_at_all_exhausts_it():
    control = RateController()
    drive(control, 6.0, queue_s=1.0, received_bps=30e3)
    assert control.exhausted
    drive(control, 0.3)
    assert control.target_bps > RateSettings().min_bps
    assert control.exhausted, "a moment of relief gives nothing that would help"
    drive(control, 5.0)
    assert not control.exhausted


def test_silence_halves_it_again_and_again():
    control = RateController()
    now_ns = drive(control, 1.0)
    for step in range(60):
        control.on_time(now_ns + step * STEP_NS)
    assert control.exhausted


def test_before_the_first_report_it_stays():
    control = RateController()
    control.on_time(100 * NS)
    assert control.target_bps == RateSettings().start_bps


# --- criteria -----------------------------------------------------------------------------------------------------------

CRITERIA = Criteria(min_fps=8.0, min_quality=0.5, patience_s=3.0)


def margins(values: list[tuple[float, float]], *, exhausted: bool = True) -> list[float]:
    """Return the fps margin at each of (seconds, fps)."""
    watch = Watch(CRITERIA, 0)
    return [watch.look(fps=fps, quality=0.9, exhausted=exhausted, now_ns=int(at_s * NS)).fps for at_s, fps in values]


def test_a_margin_is_the_best_of_what_is_forgiven():
    assert margins([(0.0, 20.0), (1.0, 2.0), (2.0, 2.0), (2.2, 2.0)]) == [12.0, 12.0, 12.0, -6.0]
    assert margins([(0.0, 20.0), (1.9, 2.0), (2.1, 9.0), (4.0, 2.0), (4.2, 2.0)]) == [12.0, 12.0, 1.0, 1.0, -6.0]


def test_adaptation_that_has_something_left_to_give_never_ends_it():
    assert margins([(float(s), 0.0) for s in range(10)], exhausted=False)[-1] == 0.0


@pytest.mark.parametrize(
    ("change", "words"),
    [({"min_fps": 0.0}, "frame rate is 0"), ({"min_quality": 1.0}, "quality is 1"), ({"patience_s": 0.5}, "patience is 0.5 s")],
)
def test_criteria_that_make_no_sense_are_named(change: dict, words: str):
    assert words in dataclasses.replace(CRITERIA, **change).problem()
    assert not CRITERIA.problem()


# --- encoder, sender, film ----------------------------------------------------------------------------------------------


def test_an_encoded_frame_decodes_to_the_size_of_its_level():
    encoder = Encoder()
    first = encoder.encode(picture(0), stamp_ns=0, size=(160, 90), bit_rate_bps=300e3, fps=20.0)
    second = encoder.encode(picture(1), stamp_ns=STEP_NS, size=(160, 90), bit_rate_bps=300e3, fps=20.0)
    assert (first.key, second.key) == (True, False)
    decoder = av.VideoCodecContext.create("h264", "r")
    decoder.thread_count = 1
    shown = [frame for each in (first, second) for frame in decoder.decode(av.Packet(b"".join(h264_depayload(p) for p in each.payloads)))]
    assert [(frame.width, frame.height) for frame in shown] == [(160, 90), (160, 90)]


def test_frames_are_identified_and_sent_again_once():
    sender = VideoSender(SEAL)
    frames = [sender.frame(picture(n, 640, 360), n * STEP_NS, n * STEP_NS) for n in range(3)]
    packets = [VideoPacket.parse(data, SEAL) for frame in frames if frame for data in frame.datagrams]
    assert [(p.mark.frame_id, p.mark.index) for p in packets] == [(f.frame_id, i) for f in frames if f for i in range(len(f.datagrams))]
    wanted = VideoReport(1, 3 * STEP_NS, newest_id=2, missing=((0, 0), (99, 0), (0, 9999))).pack(SEAL)
    (resent,) = (VideoPacket.parse(data, SEAL) for data in sender.feedback(wanted, 3 * STEP_NS))
    assert (resent.sequence, resent.mark, resent.payload) == (packets[0].sequence, packets[0].mark, packets[0].payload)
    assert (packets[0].sent_ns, resent.sent_ns) == (0, 3 * STEP_NS), "what it waited for is not the radio's delay"
    assert sender.feedback(wanted, 4 * STEP_NS) == [], "a replayed report"
    again = VideoReport(2, 4 * STEP_NS, newest_id=2, missing=((0, 0),)).pack(SEAL)
    assert sender.feedback(again, 4 * STEP_NS) == [], "it may still be under way"


def test_a_wanted_key_frame_is_made():
    sender = VideoSender(SEAL)
    assert sender.frame(picture(0), 0, 0).key
    assert not sender.frame(picture(1), STEP_NS, STEP_NS).key
    sender.feedback(VideoReport(1, 2 * STEP_NS, newest_id=1, want_key=True).pack(SEAL), 2 * STEP_NS)
    assert sender.frame(picture(2), 2 * STEP_NS, 2 * STEP_NS).key


def test_a_full_radio_is_given_time_but_asked_now_and_then():
    sender = VideoSender(SEAL)
    sender.feedback(VideoReport(1, 0, newest_id=-1).pack(SEAL), 0)
    sent = [n for n in range(40) if sender.frame(picture(n), n * STEP_NS, n * STEP_NS) is not None]
    gaps = np.diff(sent)
    assert max(gaps) * 0.05 <= 0.45, "a frame has to find out that the way is free again"
    assert len(sent) < 25


def test_a_film_keeps_the_pictures_well_enough_to_measure_them(tmp_path):
    film = Film(tmp_path / "film.mkv", (320, 180))
    ramp = np.linspace(0, 255, 320 * 3).reshape(1, 320, 3).repeat(180, 0).astype(np.uint8)
    smooth = [np.ascontiguousarray(np.roll(ramp, 9 * n, axis=1)) for n in range(10)]
    for number, image in enumerate(smooth):
        assert film.add(image, 5 * NS + number * STEP_NS) == number
    film.close()
    with av.open(str(tmp_path / "film.mkv")) as container:
        frames = [(float(frame.time), frame.to_ndarray(format="rgb24")) for frame in container.decode(video=0)]
    assert [round(at_s, 3) for at_s, _ in frames] == [round(n * 0.05, 3) for n in range(10)]
    assert max(float(np.abs(a.astype(int) - b).mean()) for (_, a), b in zip(frames, smooth, strict=True)) < 3.0


def test_random_orders_of_events_never_break_the_sender():
    chance = random.Random(5)  # noqa: S311 - no secret
    sender, now_ns = VideoSender(SEAL), 0
    for number in range(60):
        now_ns += chance.randrange(1, NS // 4)
        sender.frame(picture(number, 64, 48), now_ns, now_ns)
        report = VideoReport(
            chance.randrange(100),
            now_ns - chance.randrange(NS),
            newest_id=chance.randrange(-1, number + 1),
            queue_s=chance.random(),
            loss=chance.random(),
            received_bps=chance.random() * 3e6,
            missing=tuple((chance.randrange(70), chance.randrange(5)) for _ in range(5)),
            want_key=chance.random() < 0.3,
        )
        assert all(isinstance(data, bytes) for data in sender.feedback(report.pack(SEAL), now_ns))
    assert RateSettings().min_bps <= sender.target_bps <= RateSettings().max_bps
