"""Pictures of a camera without a ROS driver: a V4L2 device, or any file or address that FFmpeg reads. No ROS."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np

from video_stream.encoder import Rgb

OPEN_TIMEOUT_S, READ_TIMEOUT_S = 5.0, 2.0
LONGEST_WAIT_S = 0.02


class CameraError(RuntimeError):
    """The source can't be opened, or gives no more pictures; the message names it and the remedy."""


@dataclass(frozen=True, kw_only=True)
class CameraSource:
    """A source of pictures. ``name``: ``/dev/video0``, a file, or an address as ``rtsp://...``; a device is asked for size and rate."""

    name: str
    width: int = 640
    height: int = 360
    fps: float = 20.0

    @property
    def is_device(self) -> bool:
        """Return whether it is read as V4L2."""
        return self.name.startswith("/dev/")


class Camera:
    """Reads a source to its end, or for ever: a file begins again, each of its pictures at its time."""

    def __init__(self, source: CameraSource) -> None:
        """Open it; raises CameraError."""
        self._source = source
        self._container = self._opened(source)
        self._is_file = Path(source.name).is_file()

    def pictures(self, now_s: Callable[[], float], wait: Callable[[float], bool]) -> Iterator[Rgb]:
        """Yield pictures (H, W, 3) uint8 RGB as they come; raises CameraError when none come any more.

        A file is shown by ``now_s``; ``wait(seconds)`` lets time pass and returns whether to end.
        """
        while True:
            begun_s, first_s = now_s(), None
            for frame in self._frames():
                first_s = frame.time or 0.0 if first_s is None else first_s
                due_s = begun_s + (frame.time or 0.0) - first_s
                while self._is_file and now_s() < due_s:
                    if wait(min(max(due_s - now_s(), 0.0), LONGEST_WAIT_S)):
                        return
                if wait(0.0):
                    return
                yield np.asarray(frame.to_ndarray(format="rgb24"), dtype=np.uint8)
            if not self._is_file or first_s is None:
                raise CameraError(f"camera {self._source.name}: no more images come")
            self._container.close()
            self._container = self._opened(self._source)

    def close(self) -> None:
        """Close the device or file."""
        self._container.close()

    def _frames(self) -> Iterator[av.VideoFrame]:
        try:
            yield from self._container.decode(video=0)
        except (av.FFmpegError, OSError) as error:
            raise CameraError(f"camera {self._source.name}: {_reason(error)}") from error

    @staticmethod
    def _opened(source: CameraSource) -> av.container.InputContainer:
        asked = {"video_size": f"{source.width}x{source.height}", "framerate": f"{source.fps:g}"} if source.is_device else {}
        kind = "v4l2" if source.is_device else None
        try:
            container = av.open(source.name, format=kind, options=asked, timeout=(OPEN_TIMEOUT_S, READ_TIMEOUT_S))
        except (av.FFmpegError, OSError) as error:
            raise CameraError(
                f"camera {source.name} can't be opened: {_reason(error)}; name a V4L2 device (v4l2-ctl --list-devices) that takes "
                f"{source.width}x{source.height} at {source.fps:g} Hz, or a film or an address that FFmpeg reads"
            ) from error
        if not container.streams.video:
            container.close()
            raise CameraError(f"camera {source.name}: it delivers no images")
        return container


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)


class CameraThread:
    """Reads a source in a thread of its own and passes each picture on; a source that ends reports the reason, once."""

    def __init__(
        self, source: CameraSource, give: Callable[[Rgb], None], *, now_s: Callable[[], float], ended: Callable[[str], None]
    ) -> None:
        """Open the source; raises CameraError."""
        self._camera = Camera(source)
        self._give, self._now_s, self._ended = give, now_s, ended
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="camera", daemon=True)

    def start(self) -> None:
        """Start the thread that reads frames."""
        self._thread.start()

    def close(self) -> None:
        """Stop reading, and release the device."""
        self._over.set()
        self._thread.join(READ_TIMEOUT_S)
        if not self._thread.is_alive():
            self._camera.close()

    def _run(self) -> None:
        try:
            for image in self._camera.pictures(self._now_s, self._over.wait):
                self._give(image)
        except CameraError as error:
            self._ended(str(error))
