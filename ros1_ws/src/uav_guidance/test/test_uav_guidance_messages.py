"""Frames of messages: what comes in `odom` becomes `map`, and what goes out says which of them it is in."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

rospy = pytest.importorskip("rospy")

from geometry_msgs.msg import Point, Quaternion, TransformStamped, Vector3  # noqa: E402
from std_msgs.msg import Header  # noqa: E402
from tf2_msgs.msg import TFMessage  # noqa: E402
from uav_msgs.msg import Obstacle  # noqa: E402

from perception_core.conversions import matrix_of_transform  # noqa: E402
from uav_guidance.localization import Correction  # noqa: E402
from uav_guidance.messages import correction_message, map_to_odom, pose_message, sighting  # noqa: E402
from uav_guidance.vectors import Vec3  # noqa: E402
from uav_guidance.vehicle import VehicleSnapshot  # noqa: E402

CORRECTION = Correction(math.pi / 2, Vec3(1.0, 2.0, 0.5))


def transform(parent: str, child: str) -> TransformStamped:
    item = TransformStamped(header=Header(frame_id=parent), child_frame_id=child)
    item.transform.translation, item.transform.rotation = Vector3(1.0, 2.0, 3.0), Quaternion(0.0, 0.0, 0.6, 0.8)
    return item


@pytest.mark.parametrize(("frame", "place"), [("odom", Vec3(1.0, 6.0, 3.5)), ("/odom", Vec3(1.0, 6.0, 3.5)), ("map", Vec3(4.0, 0.0, 3.0))])
def test_an_obstacles_place_is_taken_in_the_frame_that_it_says(frame, place):
    message = Obstacle(header=Header(frame_id=frame), source="zed", detected=True, distance_m=4.0, nearest_enu_m=Point(4.0, 0.0, 3.0))
    assert (sighting(message, CORRECTION).nearest_enu_m - place).norm < 1e-9


def test_only_the_mappings_transform_is_taken():
    others = [transform("odom", "base_link"), transform("odom", "guidance_map"), transform("world", "map")]
    assert map_to_odom(TFMessage(transforms=others)) is None
    taken = map_to_odom(TFMessage(transforms=[*others, transform("/map", "odom")]))
    assert taken is not None
    assert (taken.rotation_xyzw, taken.translation_m) == ((0.0, 0.0, 0.6, 0.8), Vec3(1.0, 2.0, 3.0))


def test_the_map_as_flown_is_a_frame_of_its_own_that_turns_places_into_odom():
    (item,) = correction_message(CORRECTION, rospy.Time(5)).transforms
    assert (item.header.frame_id, item.child_frame_id, item.header.stamp) == ("odom", "guidance_map", rospy.Time(5))
    in_odom = CORRECTION.to_odom(Vec3(4.0, -3.0, 2.0))
    assert (matrix_of_transform(item.transform) @ [4.0, -3.0, 2.0, 1.0])[:3] == pytest.approx([in_odom.x, in_odom.y, in_odom.z])


def test_the_pose_is_the_autopilots():
    vehicle = replace(VehicleSnapshot(), position_enu_m=Vec3(1.0, 2.0, 3.0), quat_xyzw=(0.0, 0.0, 0.0, 1.0))
    message = pose_message(vehicle, rospy.Time(7))
    assert message is not None
    assert message.header.frame_id == "odom"
