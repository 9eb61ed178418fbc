"""The bridge: one node in each world, the routes between them, figures and heartbeats."""

from __future__ import annotations

import logging
import os
import shutil
import sys
import threading
import time
from collections import Counter
from collections.abc import Mapping
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import TYPE_CHECKING

import rclpy
from rclpy.executors import SingleThreadedExecutor

from alula.common.fast_dds import leave, small_segment
from alula.common.files import write_json
from ros_bridge import actions, services, topics
from ros_bridge.config import ActionRoute, Direction, ServiceRoute, TopicRoute
from ros_bridge.conversion import Types
from ros_bridge.diagnostics import open_diagnostics
from ros_bridge.discovery import Discovery, GraphReader
from ros_bridge.errors import BridgeError
from ros_bridge.heartbeat import Heartbeat
from ros_bridge.master import Connection, MasterMonitor
from ros_bridge.native import load_library
from ros_bridge.parameters import ParameterMirror
from ros_bridge.plane import Plane
from ros_bridge.routes import Context, Maker, RouteTable
from ros_bridge.spinning import spin
from ros_bridge.tables import SECTION_OF, Rates, live_table, render, summary

if TYPE_CHECKING:
    from ros_bridge.config import BridgeConfig, Spec

logger = logging.getLogger("ros_bridge")

LOOK_EVERY_S = 1.0  # diagnostics and the live view
LOOKS_A_STATS_FILE = 2
CLEAR_SCREEN = "\x1b[H\x1b[J"
SPIN_END_S = 1.0


MAKERS: dict[type, Maker] = {TopicRoute: topics.make, ServiceRoute: services.make, ActionRoute: actions.make}


def may_send_bulk(config: BridgeConfig, types: Types) -> bool:
    """Return whether large messages may be sent in ROS 2: images, clouds, or whatever discovery finds."""
    for spec in config.topics:
        with suppress(BridgeError):  # told when the route is opened
            if spec.direction is Direction.ROS1_TO_ROS2:
                pair = types.message(spec.type_name, spec.ros2_type, spec.md5sum)
                if types.bulky(pair.ros2_name):
                    return True
    return bool(config.selection.include)


class Bridge:
    """All routes, running. rclpy has to be initialised."""

    def __init__(self, config: BridgeConfig, types: Types, master: Connection, name: str) -> None:
        """Start both nodes and their ends of the heartbeat; no route yet. ``name`` is that of the ROS 1 node. Raises BridgeError."""
        self._rates = Rates()
        self._rates_hz: dict[Spec, float] = {}
        self._errors = 0
        """Of all routes, at the last look."""
        self._written: Mapping[str, object] | None = None
        """What is in the file of figures."""
        self._config = config
        with nullcontext() if may_send_bulk(config, types) else small_segment():
            self._node = rclpy.create_node("ros_bridge")
        self._plane = Plane(load_library(), name, master)
        self._monitor = MasterMonitor(master, self._plane.node)
        context = Context(self._node, types, self._plane)
        self.table = RouteTable(MAKERS, context)
        self._discovery: Discovery | None = None
        self._parameters: ParameterMirror | None = None
        if config.selection.include:
            reader = GraphReader(self._node, types, master, name, config.selection)
            self._parameters = ParameterMirror(self._plane.node, master) if config.selection.parameters else None
            self._discovery = Discovery(reader, self._node, self._monitor, config.selection, self.table, config.routes)
            self._plane.links.on_refused = self._discovery.doubt
            self._plane.subscribers.on_turned_away = self._discovery.hear
            self._discovery.connect_again = self._plane.subscribers.connect_again
        self._heartbeat = Heartbeat(context, self._state)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        if self._parameters is not None:
            self._executor.add_node(self._parameters.node)
        self._diagnostics = open_diagnostics(context)
        self._spinner = threading.Thread(target=spin, args=(self._executor,), name="ros2", daemon=True)
        self._monitor.on_reachable = self._heartbeat.changed

    def _open_configured(self) -> None:
        """Open what the configuration names.

        Raises:
            BridgeError: Something of it can't cross.
        """
        self.table.reconcile(self._config.routes)
        if self.table.failed:
            raise BridgeError("\n".join(self.table.failed.values()))
        for spec in self._config.routes:
            self.table.start(spec)

    def run(self, stop: threading.Event, stats_file: Path | None) -> None:
        """Bridge until asked to stop, also by ROS 1; this thread writes the figures."""
        self._plane.node.on_shutdown = stop.set
        self._spinner.start()
        self._heartbeat.start()
        self._monitor.start()
        self._open_configured()
        counts = ", ".join(f"{len(getattr(self._config, section))} {section}" for section in SECTION_OF.values())
        logger.info("bridging %s%s", counts, " and what discovery finds" if self._discovery is not None else "")
        if self._discovery is not None:
            self._discovery.start()
        if self._parameters is not None:
            self._parameters.start()
        looks = 0
        while not stop.wait(LOOK_EVERY_S):
            looks += 1
            self._tell()
            if stats_file is not None and looks % LOOKS_A_STATS_FILE == 0:
                self._write(stats_file)
        self._heartbeat.close(SPIN_END_S / 2)
        if stats_file is not None:
            self._write(stats_file)

    def _tell(self) -> None:
        """Publish the diagnostics, and draw the live view on a terminal."""
        figures = self.table.figures()
        self._rates_hz = self._rates.update(figures, time.monotonic())
        self._errors = sum(one.errors for one in figures.values())
        if self._diagnostics is not None:
            decisions = self._discovery.decisions if self._discovery is not None else []
            self._diagnostics.publish(figures, self._rates_hz, self.table.failed, decisions)
        if sys.stdout.isatty():
            rows = live_table(figures, self._rates_hz)[: shutil.get_terminal_size().lines - 2]
            sys.stdout.write(CLEAR_SCREEN + render(rows))
            sys.stdout.flush()

    def _write(self, stats_file: Path) -> None:
        figures = summary(self.table.figures(), self._rates_hz)
        if figures == self._written and stats_file.is_file():
            return
        try:
            write_json(stats_file, figures)
            self._written = figures
        except OSError as error:
            logger.warning("the figures can't be written to %s: %s", stats_file, error)

    def _state(self) -> dict[str, object]:
        """Return the content of a heartbeat besides its number."""
        routes = Counter(SECTION_OF[type(spec)] for spec in self.table.running())
        return {
            "pid": os.getpid(),
            "ros1_master": self._monitor.state.reachable,
            **{section: routes[section] for section in SECTION_OF.values()},
            "errors": self._errors,
        }

    def close(self) -> None:
        """End the routes, first the callers' side, then the executor."""
        self._monitor.close()
        if self._discovery is not None:
            self._plane.links.on_refused = lambda _: None
            self._plane.subscribers.on_turned_away = lambda _: None
            self._discovery.close()
        if self._parameters is not None:
            self._parameters.close()
        self.table.close()
        if self._diagnostics is not None:
            self._diagnostics.close()
        self._plane.close()
        self._executor.shutdown(timeout_sec=SPIN_END_S)
        if self._spinner.is_alive():
            self._spinner.join(SPIN_END_S)
        if not self._spinner.is_alive():
            leave(self._node)
