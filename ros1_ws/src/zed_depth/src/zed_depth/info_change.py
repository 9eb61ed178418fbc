"""Has the calibration changed while images came? That of a camera does not: one of both is wrong, and which one no pair tells."""

from __future__ import annotations

from typing import TYPE_CHECKING

from perception_core import FINE, FaultKind, Finding, unsure

if TYPE_CHECKING:
    from zed_depth.calibration import StereoCalibration

SAME = 0.02  # of focal lengths and baseline: by as much the depths change
SAME_PLACE = 0.001  # of the width, of what is measured in pixels: 0.6 px of 640
CAUSES = "the driver has read another camera_info", "two drivers publish it"


def change_finding(before: StereoCalibration, now: StereoCalibration) -> Finding:
    """Return whether the calibration of good images is another one now; that of images of another size may be the same."""
    width, now_width = before.size[1], now.size[1]
    was, is_now = before.full, now.full
    in_widths = {
        "the focal length": (was.fx / width, is_now.fx / now_width, SAME * was.fx / width),
        "the focal length along the columns": (was.fy / width, is_now.fy / now_width, SAME * was.fy / width),
        "the principal point": (was.cx / width, is_now.cx / now_width, SAME * was.fx / width),
        "the row of the principal point": (was.cy / width, is_now.cy / now_width, SAME * was.fx / width),
        "the distance of both principal points": (was.offset_px / width, is_now.offset_px / now_width, SAME_PLACE),
    }
    changes = [
        f"{name} from {one * width:.1f} to {other * now_width:.1f} px"
        for name, (one, other, same) in in_widths.items()
        if abs(other - one) > same
    ]
    if abs(is_now.baseline_m - was.baseline_m) > SAME * was.baseline_m:
        changes.insert(0, f"the baseline from {was.baseline_m:.3f} to {is_now.baseline_m:.3f} m")
    return unsure(FaultKind.INFO, f"camera_info has changed while images came, {changes[0]}", *CAUSES) if changes else FINE
