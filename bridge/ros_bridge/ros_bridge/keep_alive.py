"""Keep routes for a while after their last publisher or subscriber has gone.

A publisher that sends one message and leaves must not take the route with it before the message has arrived, and a subscriber that
restarts must not find everything torn down.
"""

from __future__ import annotations

from collections.abc import Iterable

from ros_bridge.decisions import RouteDecision
from ros_bridge.routes import Key, key_of

KEEP_ALIVE_S = 5.0


class KeepAlive:
    """Remembers until when each route is wanted."""

    def __init__(self) -> None:
        self._last: dict[Key, RouteDecision] = {}
        self._wanted_until_s: dict[Key, float] = {}
        self._flows_until_s: dict[Key, float] = {}

    def update(self, wanted: Iterable[RouteDecision], now_s: float) -> list[RouteDecision]:
        """Return the wanted routes and those that were until ``KEEP_ALIVE_S`` ago; one that has lost its receivers flows as long."""
        now = {key_of(one.spec): one for one in wanted}
        for key, one in now.items():
            self._wanted_until_s[key] = now_s + KEEP_ALIVE_S
            if one.receivers:
                self._flows_until_s[key] = now_s + KEEP_ALIVE_S
            elif now_s < self._flows_until_s.get(key, now_s) and key in self._last:
                now[key] = RouteDecision(one.spec, self._last[key].receivers)
        for key, one in self._last.items():
            if key not in now and now_s < self._wanted_until_s[key]:
                now[key] = one
        self._last = now
        self._wanted_until_s = {key: until for key, until in self._wanted_until_s.items() if key in now}
        self._flows_until_s = {key: until for key, until in self._flows_until_s.items() if key in now}
        return list(now.values())
