"""Keep of a run what its replays need: ``pack.py RUN FOLDER [--sensors]``.

Pictures of the tree go, and topics that no hook, no tree and, with ``--sensors``, no perception reads. Measurements are kept half as
often and smaller: images of half the width and height in steps of 8 grey levels, every fifth point of a cloud to 1/64 m.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType, Writer
from rosbags.highlevel import AnyReader
from rosbags.interfaces import ConnectionExtRosbag1
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.typesys import Stores, get_typestore

from alula.common.record import FILE, TREE, read_record

BAG = "functional.bag"
TOPICS = {
    "/calls",
    "/uav_guidance/state",
    "/zed_depth/obstacle",
    "/lidar_obstacles/obstacle",
    "/lidar_mapping/state",
    "/video_stream/state",
}


EVERY = 2
GREY_LEVELS = 8
POINTS = 5
CLOUD_STEPS = 64
Thin = Callable[[Any], Any]


def pack_record(source: Path, target: Path) -> None:
    """Write the record compressed, and without the views of the tree."""
    with target.open("wb") as file:
        writer = Writer(file, compression=CompressionType.ZSTD, chunk_size=1 << 18)
        writer.start(profile="", library="alula")
        channels: dict[str, int] = {}
        for entry in read_record(source):
            if entry.topic == TREE:
                continue
            if entry.topic not in channels:
                schema = writer.register_schema(f"alula{entry.topic.replace('/', '.')}", "jsonschema", b'{"type": "object"}')
                channels[entry.topic] = writer.register_channel(entry.topic, "json", schema)
            data = json.dumps(entry.value).encode()
            writer.add_message(channels[entry.topic], log_time=entry.stamp_ns, publish_time=entry.stamp_ns, data=data)
        writer.finish()


def pack_bag(source: Path, target: Path, topics: Mapping[str, Thin | None]) -> None:
    """Write some topics, compressed; those with a way to make them smaller smaller."""
    target.unlink(missing_ok=True)
    writer = BagWriter(target)
    writer.set_compression(BagWriter.CompressionFormat.BZ2)
    with AnyReader([source], default_typestore=get_typestore(Stores.ROS1_NOETIC)) as reader, writer:
        kept, seen = {}, Counter[str]()
        for connection in reader.connections:
            if connection.topic in topics and isinstance(connection.ext, ConnectionExtRosbag1):
                kept[connection.id] = writer.add_connection(
                    connection.topic,
                    connection.msgtype,
                    msgdef=connection.msgdef.data,
                    md5sum=connection.digest,
                    callerid=connection.ext.callerid,
                    latching=connection.ext.latching,
                )
        for connection, stamp_ns, raw in reader.messages():
            thin = topics.get(connection.topic)
            if connection.id not in kept:
                continue
            if thin is None:
                writer.write(kept[connection.id], stamp_ns, raw)
                continue
            seen[connection.topic] += 1
            if seen[connection.topic] % EVERY == 0:
                message = thin(reader.deserialize(raw, connection.msgtype))
                writer.write(kept[connection.id], stamp_ns, reader.typestore.serialize_ros1(message, connection.msgtype))


# --- measurements: half as often, and smaller ---------------------------------------------------------------------------


def smaller_image(image: Any) -> Any:
    """Return an image of half the width and height, its grey levels rounded."""
    pixels = np.reshape(image.data, (image.height, image.step))[:, : image.width].astype(np.float64)
    mean = pixels.reshape(image.height // 2, 2, image.width // 2, 2).mean(axis=(1, 3))
    data = np.clip(np.round(mean / GREY_LEVELS) * GREY_LEVELS, 0, 255).astype(np.uint8)
    return replace(image, height=data.shape[0], width=data.shape[1], step=data.shape[1], data=data.reshape(-1))


def smaller_info(info: Any) -> Any:
    """Return the calibration of an image of half the width and height: a pixel's middle is that of the four it is made of."""
    halves = np.array([[0.5, 0.0, -0.25], [0.0, 0.5, -0.25], [0.0, 0.0, 1.0]])
    matrices = {"K": (halves @ np.reshape(info.K, (3, 3))).reshape(-1), "P": (halves @ np.reshape(info.P, (3, 4))).reshape(-1)}
    return replace(info, height=info.height // 2, width=info.width // 2, **matrices)


def smaller_cloud(cloud: Any) -> Any:
    """Return a cloud with some of the points, their numbers rounded."""
    points = np.reshape(cloud.data, (-1, cloud.point_step))[::POINTS].copy().view(np.float32)
    rounded = (np.round(points * CLOUD_STEPS) / CLOUD_STEPS).astype(np.float32)
    return replace(cloud, height=1, width=len(points), row_step=rounded.nbytes, data=rounded.view(np.uint8).reshape(-1))


SENSORS: Mapping[str, Thin | None] = {
    "/zed/left/image_raw": smaller_image,
    "/zed/right/image_raw": smaller_image,
    "/zed/left/camera_info": smaller_info,
    "/zed/right/camera_info": smaller_info,
    "/lidar/points": smaller_cloud,
    "/imu/data": None,
    "/uav_guidance/pose": None,
    "/tf": None,
    "/tf_static": None,
}


def main(source: Path, target: Path, *, sensors: bool) -> None:
    """Pack a run."""
    pack_record(source / FILE, target / FILE)
    pack_bag(source / BAG, target / BAG, {**dict.fromkeys(TOPICS), **(SENSORS if sensors else {})})


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), sensors="--sensors" in sys.argv)
