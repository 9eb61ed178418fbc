"""Which library and setting encodes the telepilot's video best: the same frames, the same bits, side by side."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from statistics import fmean, median

import av
import numpy as np
from aiortc.codecs.h264 import H264Encoder, h264_depayload
from video_stream.encoder import KEY_INTERVAL_S, PRESET, TUNE, Encoder

from ground_station.quality import Rgb, grey, ssim

RATE_BPS = 1e6
FPS = 20.0
WARM_UP_FRAMES = 20  # the first picture costs what it costs; it is not what a radio is filled with later
PASSES = 3  # to come near the wanted bits: each encoder has an idea of its own of what a bit rate is

Encode = Callable[[Sequence[Rgb], float], Iterator[bytes]]
"""Encodes pictures at a bit rate; yields the data of each as a decoder wants it."""


@dataclass(frozen=True)
class Row:
    """How one candidate does, after the first second. Times are the CPU's; ``largest_ms``: what the largest frame takes of the radio."""

    name: str
    ssim: float
    encode_ms: float
    encode_p95_ms: float
    kbit_s: float
    largest_ms: float


def ours(preset: str) -> Encode:
    """The encoder of ``video_stream`` with another preset."""

    def encode(images: Sequence[Rgb], rate_bps: float) -> Iterator[bytes]:
        encoder = Encoder(preset)
        for number, image in enumerate(images):
            height, width = image.shape[:2]
            stamp_ns = round(number / FPS * 1e9)
            encoded = encoder.encode(image, stamp_ns=stamp_ns, size=(width, height), bit_rate_bps=rate_bps, fps=FPS)
            yield b"".join(map(h264_depayload, encoded.payloads))

    return encode


def plain(preset: str, *, joinable: bool = True) -> Encode:
    """What ``ffmpeg -preset PRESET -tune zerolatency -b:v RATE -g N`` does: libx264 of the same PyAV, nothing else said.

    ``joinable``: with key frames as often as ``video_stream`` has them; else N is libx264's own 250.
    """

    def encode(images: Sequence[Rgb], rate_bps: float) -> Iterator[bytes]:
        codec = av.VideoCodecContext.create("libx264", "w")
        height, width = images[0].shape[:2]
        codec.width, codec.height, codec.pix_fmt = width, height, "yuv420p"
        codec.framerate, codec.time_base = Fraction(round(FPS)), Fraction(1, round(FPS))
        codec.bit_rate = round(rate_bps)
        codec.thread_count = 1
        codec.options = {"preset": preset, "tune": TUNE, "g": str(round(KEY_INTERVAL_S * FPS) if joinable else 250)}
        for number, image in enumerate(images):
            yield b"".join(bytes(packet) for packet in codec.encode(_frame(image, number)))

    return encode


def aiortc(images: Sequence[Rgb], rate_bps: float) -> Iterator[bytes]:
    """The encoder of aiortc's own peer connection: libx264, baseline profile, preset medium."""
    encoder = H264Encoder()
    encoder.target_bitrate = round(rate_bps)
    for number, image in enumerate(images):
        payloads, _ = encoder.encode(_frame(image, number))
        yield b"".join(map(h264_depayload, payloads))


def _frame(image: Rgb, number: int) -> av.VideoFrame:
    frame = av.VideoFrame.from_ndarray(image, format="rgb24").reformat(format="yuv420p")
    frame.pts, frame.time_base = number, Fraction(1, round(FPS))
    return frame


CANDIDATES: dict[str, Encode] = {
    **{f"video_stream, {preset}": ours(preset) for preset in ("ultrafast", "superfast", "veryfast")},
    **{f"ffmpeg's settings, {preset}": plain(preset) for preset in ("ultrafast", "superfast", "veryfast")},
    "ffmpeg's settings, veryfast, a key frame in 12.5 s": plain("veryfast", joinable=False),
    "aiortc's own encoder": aiortc,
}
OURS, FFMPEG = f"video_stream, {PRESET}", f"ffmpeg's settings, {PRESET}"


def compare(images: Sequence[Rgb], candidates: dict[str, Encode] | None = None) -> list[Row]:
    """Encode the same pictures with each candidate so that all come out at ``RATE_BPS``."""
    return [_measure(name, encode, images) for name, encode in (candidates or CANDIDATES).items()]


def _measure(name: str, encode: Encode, images: Sequence[Rgb]) -> Row:
    rate_bps = RATE_BPS
    for _ in range(PASSES):
        data, times_s = _timed(encode(images, rate_bps))
        sizes = [len(each) for each in data[WARM_UP_FRAMES:]]
        made_bps = 8.0 * sum(sizes) * FPS / len(sizes)
        rate_bps *= RATE_BPS / made_bps
    return Row(
        name=name,
        ssim=_similarity(images, data),
        encode_ms=1e3 * median(times_s[WARM_UP_FRAMES:]),
        encode_p95_ms=1e3 * float(np.percentile(times_s[WARM_UP_FRAMES:], 95)),
        kbit_s=1e-3 * made_bps,
        largest_ms=8e3 * max(sizes) / RATE_BPS,
    )


def _timed(encoded: Iterator[bytes]) -> tuple[list[bytes], list[float]]:
    data: list[bytes] = []
    times_s: list[float] = []
    begun_s = time.process_time()
    for each in encoded:
        times_s.append(time.process_time() - begun_s)
        data.append(each)
        begun_s = time.process_time()
    return data, times_s


def _similarity(images: Sequence[Rgb], data: Sequence[bytes]) -> float:
    decoder = av.VideoCodecContext.create("h264", "r")
    decoder.thread_count = 1
    values = []
    for image, each in zip(images, data, strict=True):
        values += [ssim(grey(image), grey(frame.to_ndarray(format="rgb24"))) for frame in decoder.decode(av.Packet(each))]
    return fmean(values[WARM_UP_FRAMES:])


def table(rows: Sequence[Row]) -> str:
    """Return the rows as a table of Markdown."""
    lines = [f"| at {RATE_BPS / 1e6:g} Mbit/s | SSIM | CPU ms a frame (median, 95 %) | kbit/s | largest frame |", "|---|---|---|---|---|"]
    lines += [
        f"| {row.name} | {row.ssim:.4f} | {row.encode_ms:.1f}, {row.encode_p95_ms:.1f} | {row.kbit_s:.0f} | {row.largest_ms:.0f} ms |"
        for row in rows
    ]
    return "\n".join(lines) + "\n"
