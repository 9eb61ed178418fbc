"""The requests to the guidance, and the checks that refuse a request before anything is changed."""

from __future__ import annotations

import math
from dataclasses import dataclass

from uav_guidance.commands import Procedure
from uav_guidance.settings import GuidanceSettings
from uav_guidance.vectors import Vec3
from uav_guidance.vehicle import Landed, VehicleSnapshot


class Refusal(Exception):  # noqa: N818  # it is an answer, not an error
    """A request is refused; the text has the reason, with the value and the limit."""


@dataclass(frozen=True)
class TakeoffRequest:
    """Arm and climb to a height above home."""

    height_m: float
    speed_m_s: float


@dataclass(frozen=True)
class PositionRequest:
    """Fly straight to a place of `map`; the nose turns into the travel first, or is left to the heading reference."""

    target_enu_m: Vec3
    speed_m_s: float
    along_travel: bool


@dataclass(frozen=True)
class HeadingRequest:
    """Turn on the spot, or lock the heading while other references move the vehicle, or release the lock."""

    yaw_rad: float
    rate_rad_s: float
    lock: bool = False
    release: bool = False


@dataclass(frozen=True)
class HoverRequest:
    """Stop as soon as possible and stay there; before lift-off: give the take-off up."""


@dataclass(frozen=True)
class StopRequest:
    """End what is not supervised any more: as a hover, but a landing under way goes on, and a vehicle on the ground has nothing to end."""


@dataclass(frozen=True)
class LandRequest:
    """Request to land at the present place; it has no parameters."""


@dataclass(frozen=True)
class AuthorityRequest:
    """An operator requests the companion's authority over the vehicle (again)."""


Request = TakeoffRequest | PositionRequest | HeadingRequest | HoverRequest | StopRequest | LandRequest | AuthorityRequest


@dataclass(frozen=True)
class GuidanceDecision:
    """The answer to a request; while ``procedure`` has no outcome the autopilot has not yet agreed."""

    accepted: bool
    reason: str = ""
    reference_id: int = 0
    procedure: Procedure | None = None


def require(condition: bool, reason: str) -> None:  # noqa: FBT001  # reads as a sentence
    """Refuse unless the condition holds."""
    if not condition:
        raise Refusal(reason)


def check_number(name: str, value: float, most: float) -> None:
    """Refuse what is not a positive number up to the limit."""
    require(math.isfinite(value), f"{name} is {value}: not a number")
    require(value > 0.0, f"{name} is {value:g}: it must be positive")
    require(value <= most, f"{name} is {value:g}: at most {most:g} is allowed")


def check_fence(target_enu_m: Vec3, vehicle: VehicleSnapshot, settings: GuidanceSettings) -> None:
    """Refuse a target outside the fence: an upright cylinder around home, without the layer next to the ground."""
    require(target_enu_m.finite, f"target ({target_enu_m.x}, {target_enu_m.y}, {target_enu_m.z}): not a number")
    home = vehicle.home_enu_m
    if home is None:
        raise Refusal("home is not known yet, so the fence is not")
    offset = target_enu_m - home
    require(
        offset.horizontal <= settings.fence_radius_m,
        f"outside the fence: {offset.horizontal:.1f} m from home, at most {settings.fence_radius_m:g} m are allowed",
    )
    check_height(offset.z, settings)


def check_height(height_m: float, settings: GuidanceSettings) -> None:
    """Refuse a height above home that the fence does not allow."""
    low, high = settings.fence_floor_m, settings.fence_height_m
    require(math.isfinite(height_m), f"height is {height_m}: not a number")
    require(low <= height_m <= high, f"outside the fence: {height_m:.2f} m above home, {low:g} to {high:g} m are allowed")


def check_flying(vehicle: VehicleSnapshot) -> None:
    """Refuse unless the vehicle is in the air and not on its way up."""
    require(vehicle.landed is not Landed.UNDEFINED, "the autopilot has not said whether it is in the air")
    require(not vehicle.on_ground, "not in the air")
    require(vehicle.landed is not Landed.TAKING_OFF, "still taking off")
    require(vehicle.located, "the autopilot does not say where it is")


def check_takeoff(vehicle: VehicleSnapshot, prearm_text: str) -> None:
    """Refuse unless the vehicle stands on the ground, has a position, and passes its own checks."""
    require(vehicle.on_ground, "not on the ground")
    require(vehicle.located, "the autopilot does not say where it is")
    require(vehicle.ready or vehicle.armed, "the autopilot is not ready" + (f": {prearm_text}" if prearm_text else ""))
