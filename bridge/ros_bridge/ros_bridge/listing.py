"""``--list``: look at both worlds for a moment, and tell what would be bridged and what can't be."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import rclpy

from alula.common.fast_dds import leave
from ros_bridge.action_types import action_type
from ros_bridge.config import ActionRoute, ServiceRoute, TopicRoute
from ros_bridge.decisions import decide
from ros_bridge.discovery import GraphReader
from ros_bridge.errors import BridgeError
from ros_bridge.graph import LIST_NODE
from ros_bridge.graph_events import GraphEvents
from ros_bridge.ros2_graph import all_named
from ros_bridge.ros2_types import interface_class
from ros_bridge.tables import list_table, render

if TYPE_CHECKING:
    from ros_bridge.config import BridgeConfig, Spec
    from ros_bridge.conversion import Types
    from ros_bridge.master import Connection

QUIET_S = 1.0
AT_MOST_S = 10.0


def list_routes(config: BridgeConfig, types: Types, master: Connection) -> str:
    """Return the table as text. rclpy has to be initialised. Raises OSError when the master does not answer any more."""
    node = rclpy.create_node(LIST_NODE)
    events = GraphEvents(node)
    reader = GraphReader(node, types, master, f"/{LIST_NODE}", config.selection)
    try:
        end_s = time.monotonic() + AT_MOST_S
        # DDS finds the others in its own time, and their names after them.
        while time.monotonic() < end_s and (events.wait(QUIET_S) or not all_named(node)):
            time.sleep(QUIET_S / 10)
        system = master.call_raw("getSystemState", f"/{LIST_NODE}")
        reader.read_ros1(system)
        reader.services.wait(AT_MOST_S)
        reader.read_ros1(system)
        decisions = decide(reader.graphs(), config.selection, reader.types, config.routes)
        return render(list_table(decisions, {spec: state_of(spec, types) for spec in config.routes}))
    finally:
        reader.services.close()
        events.close()
        leave(node)


def state_of(spec: Spec, types: Types) -> str:
    """Return why a configured route can't be, or that it is configured, and which fields have other names or don't cross."""
    ros2_type = spec.ros2_type or types.rules.to_ros2(spec.type_name)
    try:
        if isinstance(spec, ActionRoute):
            parts = [part.pair for part in action_type(types, spec.type_name, ros2_type).parts]
        elif isinstance(spec, ServiceRoute):
            service = types.service(spec.type_name, ros2_type)
            parts = [service.request, service.response]
        else:
            parts = [types.message(spec.type_name, ros2_type)]
        interface_class(ros2_type, {ActionRoute: "action", ServiceRoute: "srv", TopicRoute: "msg"}[type(spec)])
    except BridgeError as error:
        return f"can't be: {error}"
    return "; ".join(["configured", *(note for part in parts for note in part.notes)])
