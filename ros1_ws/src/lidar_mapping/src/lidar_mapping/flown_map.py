"""Where the guidance has `map`, by which it flies: a mapping that was started again in flight begins there."""

from __future__ import annotations

from threading import Condition
from typing import TYPE_CHECKING

import numpy as np
from tf2_msgs.msg import TFMessage

from perception_core.ros import RawSubscriber, matrix_of_transform
from perception_core.ros.conversions import GUIDANCE_MAP, ODOMETRY

if TYPE_CHECKING:
    from geometry_msgs.msg import Transform
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

BUFFER_BYTES = 1 << 16
WAITING = 50  # the vehicle's pose comes on the same topic, at 50 Hz
WAIT_S = 1.0  # wall clock; a guidance that runs publishes the transform at 20 Hz
UNIT_TOLERANCE = 1e-3


class FlownMap:
    """Listen to `odom -> guidance_map` on ``/tf``; the newest counts. Without a guidance there is none."""

    def __init__(self) -> None:
        self._newest: Floats | None = None
        self._heard = Condition()
        self._waited = False
        self._subscriber = RawSubscriber("/tf", TFMessage, self._on_transforms, buffer_bytes=BUFFER_BYTES, queue_size=WAITING)

    @property
    def T_map_odom(self) -> Floats | None:  # noqa: N802 -- T_target_source
        """The newest (4, 4); None while none was heard."""
        return self._newest

    def wait_for(self) -> None:
        """Wait until one was heard, `WAIT_S` at most, and only once: then no guidance runs."""
        with self._heard:
            if not self._waited:
                self._heard.wait_for(lambda: self._newest is not None, WAIT_S)
            self._waited = True

    def _on_transforms(self, message: TFMessage) -> None:
        for item in message.transforms:
            is_it = item.header.frame_id.lstrip("/") == ODOMETRY and item.child_frame_id.lstrip("/") == GUIDANCE_MAP
            if is_it and _rigid(item.transform):
                with self._heard:
                    self._newest = np.asarray(np.linalg.inv(matrix_of_transform(item.transform)), dtype=np.float64)
                    self._heard.notify_all()


def _rigid(transform: Transform) -> bool:
    q, t = transform.rotation, transform.translation
    return bool(np.isfinite([t.x, t.y, t.z]).all() and abs(np.linalg.norm([q.x, q.y, q.z, q.w]) - 1.0) < UNIT_TOLERANCE)
