"""The telepilot's end without ROS: frames put together, measured, and whole streams over a bad radio."""

from __future__ import annotations

import dataclasses
import random
import threading

import cv2
import numpy as np
import pytest
from ground_station.assembler import Assembler
from ground_station.control import ControlLink
from ground_station.quality import grey, no_reference, ssim
from ground_station.references import KEPT, References
from ground_station.rehearsal import Rehearsal
from ground_station.window import LossMeter, Shown, Window
from radio_link.conditions import PRESETS, Both, Quality
from video_stream.rate import RateSettings
from video_stream.wire import NS, Mark, VideoPacket

GOOD, DEGRADED, CRITICAL, OUT = (PRESETS[quality] for quality in Quality)
STEP_NS = NS // 20


def scenery(seed: int = 0) -> np.ndarray:
    """A wide picture of soft structures, as a facade has them."""
    rng = np.random.default_rng(seed)
    coarse = cv2.resize(rng.uniform(40, 215, (12, 60, 3)).astype(np.float32), (1920, 384), interpolation=cv2.INTER_CUBIC)
    fine = cv2.GaussianBlur(rng.normal(0, 90, (384, 1920, 3)).astype(np.float32), (0, 0), 1.2)
    return np.clip(coarse + fine, 0, 255).astype(np.uint8)


SCENERY = scenery()


def camera(number: int) -> np.ndarray:
    """The n-th picture of a slow flight along it."""
    x = (2.37 * number) % 1270
    shift = np.array([[1.0, 0.0, -x], [0.0, 1.0, -5.0 - 4.3 * np.sin(number / 9.0)]])
    return np.asarray(cv2.warpAffine(SCENERY, shift, (640, 360), flags=cv2.INTER_LINEAR))


# --- frames -------------------------------------------------------------------------------------------------------------


def packet(frame: int, index: int = 0, count: int = 2, *, key: bool = False, life: int = 0) -> VideoPacket:
    stamp_ns = (life * 1000 + frame) * STEP_NS
    return VideoPacket(10 * frame + index, Mark(frame, stamp_ns, index, count, key), bytes([0x65 if key else 0x41, frame, index]))


def feed(assembler: Assembler, packets: list[VideoPacket], now_ns: int = 0) -> list[int]:
    for each in packets:
        assembler.add(each, now_ns)
    return [whole.frame_id for whole in assembler.take(now_ns)]


def test_packets_in_any_order_make_frames_in_order():
    packets = [packet(f, i, key=f == 0) for f in range(4) for i in range(2)]
    random.Random(3).shuffle(packets)  # noqa: S311 - no secret
    assert feed(Assembler(), packets) == [0, 1, 2, 3]


def test_nothing_is_shown_before_a_key_frame():
    assembler = Assembler()
    assert feed(assembler, [packet(5, 0), packet(5, 1)]) == []
    assert assembler.want_key
    assert feed(assembler, [packet(6, 0, key=True), packet(6, 1, key=True)]) == [6]
    assert not assembler.want_key


def test_a_missing_packet_is_asked_for_and_waited_for_then_given_up():
    assembler = Assembler()
    feed(assembler, [packet(0, 0, key=True), packet(0, 1, key=True), packet(1, 0), packet(2, 0), packet(2, 1)])
    assert assembler.missing(0) == ((1, 1),)
    assert feed(assembler, [packet(1, 1)], NS // 10) == [1, 2], "it came"
    feed(assembler, [packet(4, 0), packet(4, 1)], NS)
    assert assembler.missing(NS) == ((3, 0),), "of a frame of which nothing came, the first"
    assert feed(assembler, [packet(5, 0), packet(5, 1)], 2 * NS) == []
    assert assembler.want_key
    assert feed(assembler, [packet(6, 0, key=True), packet(6, 1, key=True), packet(3, 0), packet(3, 1)], 2 * NS) == [6]


def test_a_gap_within_the_newest_frame_is_asked_for_at_once():
    assembler = Assembler()
    feed(assembler, [packet(0, 0, key=True), packet(0, 1, key=True)])
    assembler.add(packet(1, 2, count=4), now_ns=0)
    assert assembler.missing(0) == ((1, 0), (1, 1)), "others have overtaken them; the last one may be on its way"
    assert assembler.missing(NS // 10) == ((1, 0), (1, 1), (1, 3)), "nothing has come for a while"


def test_replayed_packets_change_nothing():
    assembler = Assembler()
    first = [packet(f, i, key=f == 0) for f in range(3) for i in range(2)]
    assert feed(assembler, first) == [0, 1, 2]
    assert not any(assembler.add(each, NS) for each in first)
    assert feed(assembler, []) == []


def test_a_sender_that_was_started_again_is_followed():
    assembler = Assembler()
    feed(assembler, [packet(f, i, key=f == 0) for f in range(3) for i in range(2)])
    assert feed(assembler, [packet(0, i, key=True, life=1) for i in range(2)], NS) == [0]


# --- figures ------------------------------------------------------------------------------------------------------------


def test_ssim_is_the_paper_s():
    """Against the sum over windows as the definition has it, written out."""
    rng = np.random.default_rng(1)
    a = rng.integers(0, 255, (24, 26), dtype=np.uint8)
    b = np.clip(a + rng.normal(0, 20, a.shape), 0, 255).astype(np.uint8)
    axis = np.arange(11) - 5
    weight = np.exp(-(axis[:, None] ** 2 + axis**2) / (2 * 1.5**2))
    weight /= weight.sum()
    values = []
    for y in range(5, 24 - 5):
        for x in range(5, 26 - 5):
            p, q = (each[y - 5 : y + 6, x - 5 : x + 6].astype(float) for each in (a, b))
            mp, mq = (weight * p).sum(), (weight * q).sum()
            vp, vq, c = (weight * (p - mp) ** 2).sum(), (weight * (q - mq) ** 2).sum(), (weight * (p - mp) * (q - mq)).sum()
            values.append((2 * mp * mq + 6.5025) * (2 * c + 58.5225) / ((mp**2 + mq**2 + 6.5025) * (vp + vq + 58.5225)))
    assert ssim(a, b) == pytest.approx(np.mean(values), abs=1e-4)
    assert ssim(a, a) == pytest.approx(1.0)
    with pytest.raises(ValueError, match="can't be compared"):
        ssim(a, b[:-1])


def test_the_figure_without_reference_falls_with_compression():
    image = grey(camera(0))
    scores = [
        no_reference(cv2.imdecode(cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, q])[1], cv2.IMREAD_GRAYSCALE)) for q in (90, 20, 5)
    ]
    assert scores[0] > scores[1] > scores[2]


@pytest.fixture
def asked():
    """Return what asks for a reference in a thread of its own; its list holds the answer."""
    threads = []

    def ask(references, stamp_ns):
        answers = []
        threads.append(threading.Thread(target=lambda: answers.append(references.find(stamp_ns))))
        threads[-1].start()
        return answers, threads[-1]

    yield ask
    for thread in threads:
        thread.join()


def test_a_reference_on_its_way_is_waited_for(asked):
    references = References()
    assert not references
    answers, thread = asked(references, 2 * STEP_NS)
    references.note(STEP_NS, camera(1))
    thread.join(0.05)
    assert thread.is_alive(), "an older one does not do"
    references.note(2 * STEP_NS, camera(2))
    thread.join()
    assert references
    np.testing.assert_array_equal(answers[0], camera(2))


def test_a_reference_that_was_lost_is_not_waited_for():
    references = References()
    for number in (1, 3):
        references.note(number * STEP_NS, camera(number))
    assert references.find(2 * STEP_NS) is None
    for number in range(4, 4 + KEPT):
        references.note(number * STEP_NS, camera(0))
    assert references.find(STEP_NS) is None, "long ago"


def test_a_silent_camera_is_waited_for_once_and_again_when_it_is_back(asked, monkeypatch):
    monkeypatch.setattr("ground_station.references.WAIT_S", 0.01)
    references = References()
    assert references.find(STEP_NS) is None
    monkeypatch.setattr("ground_station.references.WAIT_S", None)
    assert references.find(STEP_NS) is None, "at once: another wait would not end"
    references.note(STEP_NS, camera(1))
    answers, thread = asked(references, 2 * STEP_NS)
    references.note(2 * STEP_NS, camera(2))
    thread.join()
    np.testing.assert_array_equal(answers[0], camera(2))


def test_a_window_counts_the_last_second_only():
    window = Window()
    for number in range(40):
        window.show(Shown(number * STEP_NS, number * STEP_NS + NS // 10, 0.5 if number < 20 else 0.9))
    now_ns = 39 * STEP_NS + NS // 10
    assert window.fps(now_ns) == 20
    assert window.quality(now_ns) == pytest.approx(0.9)
    assert window.delay_s(now_ns) == pytest.approx(0.1)
    assert (window.fps(now_ns + NS), window.quality(now_ns + NS)) == (0, None)


def test_loss_is_counted_over_the_wrap_of_sequence_numbers():
    meter = LossMeter()
    for number in range(65_526, 65_546):
        if number % 4:
            meter.add(number & 0xFFFF, number)
    assert meter.loss(65_546) == pytest.approx(5 / 20, abs=0.06)


def test_the_control_link_is_a_ground_station_s_heartbeat_twice_a_second():
    link = ControlLink()
    beats = [link.due(n * NS // 10) for n in range(30)]
    assert sum(map(len, beats)) == 6, "and nothing else while the stick rests"
    assert beats[0][0][0] == 0xFD, "MAVLink 2"
    assert (beats[0][0][5], beats[0][0][6]) == (255, 190)


# --- whole streams ------------------------------------------------------------------------------------------------------


def run(seconds: float, plan: list[tuple[float, Both]], **more: object) -> Rehearsal:
    """Stream over a radio that changes at these times."""
    rehearsal = Rehearsal(camera, lambda t_s: [both for at_s, both in plan if t_s >= at_s][-1], **more)
    rehearsal.run(seconds)
    return rehearsal


def at(rehearsal: Rehearsal, t_s: float):
    return next(moment for moment in rehearsal.moments if moment.t_s >= t_s)


def test_a_step_from_4_mbit_to_500_kbit_and_back_freezes_nothing():
    narrow = Both(dataclasses.replace(GOOD.down, rate_bps=500e3), GOOD.up)
    stream = run(13.0, [(0.0, GOOD), (4.0, narrow), (9.0, GOOD)])
    assert max(stream.gaps()) <= 0.5, "seconds"
    assert all(moment.report.fps >= 8 for moment in stream.moments if moment.t_s > 6.0), "the criteria hold again within 2 s"
    assert at(stream, 8.5).level is not at(stream, 3.5).level
    assert at(stream, 8.5).report.received_bps < 600e3
    assert at(stream, 12.9).target_bps > 2 * at(stream, 8.5).target_bps
    assert not any(moment.exhausted for moment in stream.moments)


def test_a_degraded_radio_gives_a_worse_picture_but_gives_one():
    stream = run(10.0, [(0.0, GOOD), (3.0, DEGRADED)], seed=4)
    good, degraded = at(stream, 2.9).report, at(stream, 9.9).report
    assert degraded.fps >= 8
    assert 0.4 < degraded.quality < good.quality


@pytest.mark.parametrize("seed", [5, 9])
def test_a_packet_that_is_lost_as_the_radio_gets_worse_freezes_the_picture_but_briefly(seed):
    stream = run(5.0, [(0.0, GOOD), (3.0, DEGRADED)], seed=seed)
    assert max(stream.gaps()) <= 0.7, "seconds; with a queue in front of it what is sent again comes late"


def test_a_critical_radio_exhausts_the_adaptation_and_holds_no_frame_rate():
    stream = run(9.0, [(0.0, GOOD), (3.0, CRITICAL)], seed=2)
    assert at(stream, 6.0).exhausted
    assert min(moment.report.fps for moment in stream.moments if moment.t_s > 5.0) < 5


def test_after_a_second_without_radio_the_picture_comes_back():
    stream = run(8.0, [(0.0, GOOD), (3.0, OUT), (4.0, GOOD)])
    assert 0.9 < max(stream.gaps()) < 2.0
    assert at(stream, 7.0).report.fps >= 8


def test_a_busy_computer_on_board_is_no_full_radio():
    chance = random.Random(3)  # noqa: S311 - no secret
    prompt = run(4.0, [(0.0, GOOD)])
    late = run(4.0, [(0.0, GOOD)], late_ns=lambda _: int(chance.uniform(0.0, 0.25) * NS))
    assert at(prompt, 3.9).target_bps == at(late, 3.9).target_bps == RateSettings().max_bps
    assert max(moment.report.queue_s for moment in late.moments) < RateSettings().queue_limit_s
    assert at(late, 3.9).report.delay_s > at(prompt, 3.9).report.delay_s + 0.08, "the telepilot sees late pictures all the same"


def test_garbage_replays_and_disorder_on_the_way_show_no_wrong_picture():
    chance = random.Random(9)  # noqa: S311 - no secret
    heard: list[bytes] = []

    def tamper(datagrams: list[bytes]) -> list[bytes]:
        heard.extend(datagrams)
        forged = [bytearray(data) for data in datagrams]
        for each in forged:
            each[chance.randrange(12, len(each))] ^= 1 << chance.randrange(8)
        noise = [chance.randbytes(chance.randrange(0, 1500)) for _ in range(2)]
        mixed = [*datagrams, *map(bytes, forged), *noise, *chance.choices(heard or [b""], k=3)]
        chance.shuffle(mixed)
        return mixed

    stream = run(4.0, [(0.0, GOOD)], tamper=tamper)
    shown = [picture.frame_id for picture in stream.pictures]
    assert shown == sorted(set(shown)), "each frame once, in order"
    assert len(shown) >= 70, "of 80 that were filmed"
    assert min(picture.ssim for picture in stream.pictures) > 0.5
    assert stream.receiver.refused > 100
