"""A user's script, as in the README: type-checked strictly, and run by the tests against real managers."""

# ruff: noqa: T201 - a script talks to its user

from __future__ import annotations

import asyncio

from uav_client import Uav


def fly(uav: Uav, height: float) -> str:
    """Take off and say how it ended."""
    climb = uav.navigation.takeoff(height=height, speed=1.0)
    for report in climb:
        print(f"{report.state.value} {report.progress:.0%}")
    return climb.get(timeout_s=1.0).expect("AT_ALTITUDE").result


async def go(uav: Uav) -> str:
    """Fly to a point, unless the vehicle lands first."""
    leg = uav.navigation.goto(target=(4.0, 2.0, 3.0), speed=1.5)
    uav.navigation.flight_status.on_change(lambda state: leg.interrupt() if state == "ON_GROUND" else None)
    print("on the way")
    ended = await leg
    return ended.outcome


if __name__ == "__main__":
    with Uav.connect(skillsets=["navigation"]) as robot:
        print(fly(robot, height=5.0))
        print(asyncio.run(go(robot)))
        print(robot.navigation.land.why().get(5.0).reason)
