"""What the perception nodes know of the vehicle is all in the autopilot's frame; needs ROS's Python, but no master."""

from __future__ import annotations

import math

import pytest
from geometry_msgs.msg import Point, Quaternion, TransformStamped, Vector3
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage
from uav_msgs.msg import GuidanceState

from perception_core.conversions import GUIDANCE_MAP
from perception_core.vehicle import KnownVehicle


@pytest.fixture
def vehicle() -> KnownVehicle:
    return KnownVehicle()


def state(reference: str = "position") -> GuidanceState:
    return GuidanceState(reference=reference, velocity_enu_m_s=Vector3(1.0, 0.0, 0.5), target_enu_m=Point(10.0, 0.0, 3.0))


def transform(parent: str, child: str, yaw_rad: float, x: float, y: float) -> TFMessage:
    item = TransformStamped(header=Header(frame_id=parent), child_frame_id=child)
    item.transform.translation = Vector3(x, y, 0.0)
    item.transform.rotation = Quaternion(0.0, 0.0, math.sin(yaw_rad / 2.0), math.cos(yaw_rad / 2.0))
    return TFMessage(transforms=[item])


def test_motion_is_turned_from_the_guidances_map_into_the_frame_of_the_poses(vehicle: KnownVehicle) -> None:
    vehicle._on_transforms(transform("map", "odom", 1.0, 50.0, 0.0))
    vehicle._on_transforms(transform("odom", GUIDANCE_MAP, math.pi / 2, 2.0, -1.0))
    vehicle._on_state(state())
    assert vehicle.motion.velocity_enu_m_s == pytest.approx((0.0, 1.0, 0.5))
    assert vehicle.motion.target_enu_m == pytest.approx((2.0, 9.0, 3.0))
    vehicle._on_state(state("hover"))
    assert vehicle.motion.target_enu_m is None


def test_a_sensor_is_found_through_all_frames_between_and_with_a_slash_before_its_name(vehicle: KnownVehicle) -> None:
    vehicle._on_static(transform("camera", "zed_left", 0.0, 0.1, 0.0))
    with pytest.raises(LookupError, match="no transform from base_link to 'zed_left'"):
        vehicle.mount("zed_left")
    vehicle._on_static(transform("/base_link", "/camera", math.pi / 2, 2.0, 0.0))
    for name in ("zed_left", "/zed_left"):
        assert vehicle.mount(name)[:3, 3] == pytest.approx((2.0, 0.1, 0.0))
    vehicle._on_static(transform("zed_left", "camera", 0.0, 0.0, 0.0))  # a loop
    with pytest.raises(LookupError):
        vehicle.mount("zed_left")


def test_a_transform_that_is_no_motion_moves_nothing(vehicle: KnownVehicle) -> None:
    vehicle._on_transforms(transform("odom", "guidance_map", math.pi / 2, 1.0, 2.0))
    told = vehicle.T_odom_map()
    vehicle._on_transforms(transform("odom", "guidance_map", 0.0, math.nan, 0.0))
    broken = transform("odom", "guidance_map", 0.0, 0.0, 0.0)
    broken.transforms[0].transform.rotation.w = 0.0
    vehicle._on_transforms(broken)
    assert vehicle.T_odom_map() is told


def test_without_a_correction_as_in_recordings_of_before_the_motion_is_what_the_guidance_says(vehicle: KnownVehicle) -> None:
    vehicle._on_state(state())
    assert vehicle.motion.velocity_enu_m_s == (1.0, 0.0, 0.5)
    assert vehicle.motion.target_enu_m == (10.0, 0.0, 3.0)
