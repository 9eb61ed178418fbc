"""Tables and summaries of routes: for the figures' file, the diagnostics topic, the list and the live view."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from ros_bridge.config import ActionRoute, Direction, RosVersion, ServiceRoute, Spec, TopicRoute
from ros_bridge.decisions import Decision, Refused
from ros_bridge.routes import Key, key_of
from ros_bridge.stats import Figures

SECTION_OF: dict[type, str] = {TopicRoute: "topics", ServiceRoute: "services", ActionRoute: "actions"}
COLUMNS = ("what", "ROS 1", "", "ROS 2", "type", "quality of service", "state")
Table = list[tuple[str, ...]]


@dataclass
class Rates:
    """Rates of all routes, from one look at their figures to the next."""

    _before: dict[Key, tuple[float, int]] = field(default_factory=dict)

    def update(self, figures: Mapping[Spec, Figures], now_s: float) -> dict[Spec, float]:
        """Return how many a second have crossed each route since the last call (0 at the first)."""
        rates = {}
        for spec, one in figures.items():
            then_s, count = self._before.get(key_of(spec), (now_s, one.count))
            rates[spec] = (one.count - count) / (now_s - then_s) if now_s > then_s else 0.0
        self._before = {key_of(spec): (now_s, one.count) for spec, one in figures.items()}
        return rates


def to_ros2(spec: Spec) -> bool:
    """Return whether messages go, or calls are answered, from ROS 1 towards ROS 2."""
    return spec.direction is Direction.ROS1_TO_ROS2 if isinstance(spec, TopicRoute) else spec.server is RosVersion.ROS1


def summary(figures: Mapping[Spec, Figures], rates: Mapping[Spec, float]) -> dict[str, dict[str, dict[str, object]]]:
    """Return ``{"topics": {ROS 1 name: figures}, "services": ..., "actions": ...}``.

    A topic that crosses both ways has a second row, ``<name> ros2_to_ros1``.
    """
    sections: dict[str, dict[str, dict[str, object]]] = {section: {} for section in SECTION_OF.values()}
    for spec, one in sorted(figures.items(), key=lambda item: not to_ros2(item[0])):
        section = sections[SECTION_OF[type(spec)]]
        way = "ros1_to_ros2" if to_ros2(spec) else "ros2_to_ros1"
        section[spec.ros1_name if spec.ros1_name not in section else f"{spec.ros1_name} {way}"] = {
            "ros2_name": spec.ros2_name,
            "direction": way,
            "type": spec.type_name,
            "count": one.count,
            "rate_hz": round(rates.get(spec, 0.0), 2),
            "bytes": one.bytes,
            "p50_ms": one.p50_ms,
            "p95_ms": one.p95_ms,
            "dropped": sum(one.dropped.values()),
            "dropped_why": dict(one.dropped),
            "errors": one.errors,
        }
    return sections


def type_text(spec: Spec) -> str:
    """Name a route's type, and ROS 2's where it is another."""
    return spec.type_name if spec.ros2_type in {"", spec.type_name} else f"{spec.type_name} = {spec.ros2_type}"


def quality_text(spec: Spec) -> str:
    """Name the quality of service of a topic's ROS 2 end."""
    if not isinstance(spec, TopicRoute):
        return f"{spec.timeout_s:g} s"
    durability = "transient local" if spec.latched else "volatile"
    return f"{spec.reliability.value.replace('_', ' ')}, {durability}, {spec.depth}"


def list_table(decisions: Iterable[Decision], configured: Mapping[Spec, str]) -> Table:
    """Return the table of what would be bridged and what can't be; ``configured`` has the state of each configured route."""
    rows: Table = [COLUMNS]
    rows += [_row(spec, state) for spec, state in configured.items()]
    for decision in decisions:
        if isinstance(decision, Refused):
            rows.append((decision.kind, decision.ros1_name, "x", decision.ros2_name, "", "", f"can't be: {decision.reason}"))
        else:
            receivers = f"{decision.receivers} receive" if decision.receivers else "offered; no subscriber"
            state = receivers if isinstance(decision.spec, TopicRoute) else "offered"
            rows.append(_row(decision.spec, "; ".join([state, *decision.notes])))
    return rows


def _row(spec: Spec, state: str) -> tuple[str, ...]:
    kind = SECTION_OF[type(spec)].removesuffix("s")
    return (kind, spec.ros1_name, "->" if to_ros2(spec) else "<-", spec.ros2_name, type_text(spec), quality_text(spec), state)


LIVE_COLUMNS = ("ROS 1", "", "ROS 2", "type", "Hz", "count", "MB", "p50 ms", "p95 ms", "dropped", "errors")


def live_table(figures: Mapping[Spec, Figures], rates: Mapping[Spec, float]) -> Table:
    """Return the table of what crosses, the busiest first."""
    rows: Table = [LIVE_COLUMNS]
    for spec, one in sorted(figures.items(), key=lambda item: (-rates.get(item[0], 0.0), item[0].ros1_name)):
        rows.append(
            (
                spec.ros1_name,
                "->" if to_ros2(spec) else "<-",
                spec.ros2_name,
                spec.type_name,
                f"{rates.get(spec, 0.0):.1f}",
                str(one.count),
                f"{one.bytes / 1e6:.1f}",
                "" if one.p50_ms is None else f"{one.p50_ms:.2f}",
                "" if one.p95_ms is None else f"{one.p95_ms:.2f}",
                str(sum(one.dropped.values())),
                str(one.errors),
            )
        )
    return rows


def render(rows: Sequence[Sequence[str]]) -> str:
    """Return a table as text, columns as wide as their widest cell."""
    widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    return "\n".join("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows) + "\n"
