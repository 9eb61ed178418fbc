"""How a process joins and leaves DDS.

A participant writes all over its segment of shared memory as soon as it is there: the 64 MB of the profile, which hold images, are most of
what a process takes that sends none.

With the last node of a context goes its participant in DDS. Fast DDS waits then until no callback of its discovery runs, and by default has
no deadline. As compiled for the wheels (2.14.5), that wait fails at once and is repeated for ever where a callback does run: at full load,
with the lock that the callback needs, and with Python's interpreter (https://github.com/eProsima/Fast-DDS/issues/6513). With a deadline the
wait is as it should be, and there is nothing left to wait for at the end.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import re
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

DISCOVERY_ENDS_S = 10
"""Wall clock; a callback takes some microseconds, on a busy machine some milliseconds."""
SMALL_SEGMENT_BYTES = 8_000_000
"""Of a process that sends no images; a larger message comes in pieces, of which DDS may lose some where it is not reliable."""
PROFILE_VARIABLES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
"""Name the file of Fast DDS's profile; newer versions read the second."""
_SEGMENT = re.compile(r"(?<=<segment_size>)\s*(\d+)\s*(?=</segment_size>)")
_GET_PARTICIPANT = "_ZN16rmw_fastrtps_cpp22get_domain_participantEP10rmw_node_s"
_SET_LISTENER = (
    "_ZN8eprosima7fastdds3dds17DomainParticipant12set_listener"
    "EPNS1_25DomainParticipantListenerERKNS1_10StatusMaskENSt6chrono8durationIlSt5ratioILl1ELl1EEEE"
)


@contextlib.contextmanager
def small_segment() -> Iterator[None]:
    """Give a process a segment of at most `SMALL_SEGMENT_BYTES`: its first node, and no other process, is to be made in here."""
    given = {name: os.environ[name] for name in PROFILE_VARIABLES if os.environ.get(name)}
    try:
        profiles = {name: small_profile(Path(path).read_text(encoding="utf-8")) for name, path in given.items()}
    except OSError:  # Fast DDS says it better
        yield
        return
    with tempfile.TemporaryDirectory(prefix="alula_dds_") as folder:
        try:
            for name, profile in profiles.items():
                path = Path(folder) / f"{name}.xml"
                path.write_text(profile, encoding="utf-8")
                os.environ[name] = str(path)
            yield
        finally:
            os.environ.update(given)


def small_profile(profile: str) -> str:
    """Return a profile of Fast DDS with segments of at most `SMALL_SEGMENT_BYTES`."""
    return _SEGMENT.sub(lambda size: str(min(int(size[1]), SMALL_SEGMENT_BYTES)), profile)


def leave(node: Any) -> None:
    """Destroy the last node (rclpy's) of a context, and shut the context down."""
    stop_discovery(node)
    node.destroy_node()
    node.context.try_shutdown()


def stop_discovery(node: Any) -> bool:
    """Have all nodes of a context learn no more of others, for good; return whether that was done: not where the DDS is another one.

    `leave` does it where the context ends. In a context that goes on, no later node would find a service or a topic.
    """
    library = _library()
    if library is None:
        return False
    rmw_node, participant_of, set_listener = library
    participant = participant_of(rmw_node(node.handle.pointer))
    nothing = ctypes.c_uint64(0)
    return participant is not None and set_listener(participant, None, ctypes.byref(nothing), DISCOVERY_ENDS_S) == 0


@cache
def _library() -> tuple[Any, Any, Any] | None:
    """Return the functions of rcl, rmw and DDS that it takes, or None where they are not those that are known here."""
    try:
        rmw_node = ctypes.CDLL("librcl.so").rcl_node_get_rmw_handle
        participant_of = getattr(ctypes.CDLL("librmw_fastrtps_cpp.so"), _GET_PARTICIPANT)
        set_listener = getattr(ctypes.CDLL("libfastrtps.so.2.14"), _SET_LISTENER)
    except (OSError, AttributeError):
        return None
    for function in (rmw_node, participant_of):
        function.argtypes, function.restype = [ctypes.c_void_p], ctypes.c_void_p
    set_listener.argtypes, set_listener.restype = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_long], ctypes.c_int
    return rmw_node, participant_of, set_listener
