"""``./alula bench video``: cost, delay, a step in bandwidth, and which encoder looks best for its bits."""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from statistics import median

import cv2
import numpy as np
from radio_link.channel import Condition
from radio_link.conditions import Both
from video_stream.rate import RateSettings

from ground_station.codecs import compare, table
from ground_station.quality import Rgb
from ground_station.rehearsal import Rehearsal

IDEAL = Both(Condition(rate_bps=1e9, delay_s=0.0, jitter_s=0.0), Condition(rate_bps=1e9, delay_s=0.0, jitter_s=0.0))
WIDE, NARROW = (
    Both(Condition(rate_bps=rate_bps, queue_s=1.0, delay_s=0.025, jitter_s=0.003), Condition(rate_bps=1e6, delay_s=0.025))
    for rate_bps in (4e6, 5e5)
)
STEP_S, BACK_S, END_S = 5.0, 13.0, 20.0
MIN_FPS, MIN_QUALITY = 8.0, 0.4  # the criteria of the inspection
COMPARED_FRAMES = 120
Camera = Callable[[int], Rgb]


def simulated_camera(world: str) -> Camera:
    """Return what the simulator's camera sees along the first wall of a world, at 1 m/s."""
    from uav_simulator.sensors.camera import ColourCamera
    from uav_simulator.sensors.pose_track import Pose
    from uav_simulator.world.config import find_world, load_world
    from uav_simulator.world.parts import build_parts
    from uav_simulator.world.scene import Scene

    camera = ColourCamera(Scene(build_parts(load_world(find_world(world)), 0)), 0)
    turned = (float(np.cos(np.pi / 4)), 0.0, 0.0, float(np.sin(np.pi / 4)))  # nose to the north: quaternion, w first
    pictures: dict[int, Rgb] = {}

    def look(number: int) -> Rgb:
        if number not in pictures:
            t_s = number / 20.0
            pictures[number] = camera.render(Pose(t_s, (4.0 + t_s % 16.0, 0.0, 3.0 + 0.02 * float(np.sin(3.0 * t_s))), turned))
        return pictures[number]

    return look


def ideal(camera: Camera) -> dict[str, float]:
    """Measure times a frame and the delay over a radio without limits."""
    begun = time.process_time()
    stream = Rehearsal(camera, lambda _: IDEAL)
    stream.run(8.0)
    cpu_s = time.process_time() - begun
    delays = [(picture.shown_ns - picture.stamp_ns) * 1e-9 for picture in stream.pictures]
    return {
        "encode_ms": 1e3 * median(stream.encode_s),
        "encode_p95_ms": 1e3 * float(np.percentile(stream.encode_s, 95)),
        "decode_and_measure_ms": 1e3 * median(stream.decode_s),
        "delay_on_the_clock_ms": 1e3 * median(delays),
        "delay_ms": 1e3 * (median(delays) + median(stream.encode_s) + median(stream.decode_s)),
        "cpu_of_one_core": cpu_s / 8.0,
    }


def step(camera: Camera) -> dict[str, float]:
    """Measure the reaction to 4 Mbit/s becoming 500 kbit/s, and back."""
    stream = Rehearsal(camera, lambda t_s: NARROW if STEP_S <= t_s < BACK_S else WIDE)
    stream.run(END_S)
    missed = [m.t_s for m in stream.moments if m.t_s > STEP_S and (m.report.fps < MIN_FPS or m.report.quality < MIN_QUALITY)]
    down, up = ([t_s for t_s in missed if begin <= t_s < end] for begin, end in ((STEP_S, BACK_S), (BACK_S, END_S)))
    return {
        "longest_gap_s": max(stream.gaps(STEP_S - 0.5, END_S)),
        "criteria_hold_again_after_down_s": max(down) - STEP_S if down else 0.0,
        "criteria_hold_again_after_up_s": max(up) - BACK_S if up else 0.0,
        "ssim_wide": stream.moments[int(STEP_S * 20) - 10].report.quality,
        "ssim_narrow": stream.moments[int(BACK_S * 20) - 30].report.quality,
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print; return the exit code."""
    parser = argparse.ArgumentParser(prog="alula bench video", description="Measure the telepilot's video, without a simulator.")
    parser.add_argument("--world", default="building", help="source of the camera's images")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures to this file")
    options = parser.parse_args(arguments)
    cv2.setNumThreads(1)
    camera = simulated_camera(options.world)
    for number in range(int(END_S * 20) + 1):
        camera(number)  # its pictures are made beforehand: they are not what is measured
    figures = {"ideal": ideal(camera), "step": step(camera)}
    figures["settings"] = {"cores": float(os.cpu_count() or 0), "max_bps": RateSettings().max_bps}
    codecs = compare([camera(number) for number in range(COMPARED_FRAMES)])
    for title, part in figures.items():
        sys.stdout.write(f"{title}\n" + "".join(f"  {name:36} {value:10.3f}\n" for name, value in part.items()))
    sys.stdout.write(f"codecs\n{table(codecs)}")
    if options.json is not None:
        text = json.dumps({**figures, "codecs": [asdict(row) for row in codecs]}, indent=2)
        options.json.write_text(text + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
