"""Keep of a run what its replays need: ``pack.py RUN FOLDER``. Pictures of the tree go, and topics that no hook and no tree reads."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from mcap.writer import CompressionType, Writer
from rosbags.highlevel import AnyReader
from rosbags.interfaces import ConnectionExtRosbag1
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.typesys import Stores, get_typestore

from alula_common.record import FILE, TREE, read_record

BAG = "functional.bag"
TOPICS = {
    "/calls",
    "/uav_guidance/state",
    "/zed_depth/obstacle",
    "/lidar_obstacles/obstacle",
    "/lidar_mapping/state",
    "/video_stream/state",
}


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


def pack_bag(source: Path, target: Path) -> None:
    """Write the topics that hooks read, compressed."""
    target.unlink(missing_ok=True)
    writer = BagWriter(target)
    writer.set_compression(BagWriter.CompressionFormat.BZ2)
    with AnyReader([source], default_typestore=get_typestore(Stores.ROS1_NOETIC)) as reader, writer:
        kept = {}
        for connection in reader.connections:
            if connection.topic in TOPICS and isinstance(connection.ext, ConnectionExtRosbag1):
                kept[connection.id] = writer.add_connection(
                    connection.topic,
                    connection.msgtype,
                    msgdef=connection.msgdef.data,
                    md5sum=connection.digest,
                    callerid=connection.ext.callerid,
                    latching=connection.ext.latching,
                )
        for connection, stamp_ns, raw in reader.messages():
            if connection.id in kept:
                writer.write(kept[connection.id], stamp_ns, raw)


def main(source: Path, target: Path) -> None:
    """Pack a run."""
    pack_record(source / FILE, target / FILE)
    pack_bag(source / BAG, target / BAG)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
