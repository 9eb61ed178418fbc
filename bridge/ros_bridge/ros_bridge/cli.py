"""The command: ``ros_bridge --config FILE``, ``--all`` and their like, alone or started by roslaunch."""

from __future__ import annotations

import argparse
import logging
import os
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from alula.common.ros_arguments import split_arguments
from alula.common.signals import StopEvent
from ros_bridge import config_values, discovery_options
from ros_bridge.config_file import load_config
from ros_bridge.errors import BridgeError, ConfigError, NoMasterError
from ros_bridge.master import Connection
from ros_bridge.ros1_node import own_name

logger = logging.getLogger("ros_bridge")

EXIT_OK, EXIT_FAILED, EXIT_CONFIG = 0, 1, 2
DEFAULT_MASTER = "http://127.0.0.1:11311"
LOOPBACK = ("http://127.0.0.1", "http://localhost")


def parse_arguments(arguments: Sequence[str]) -> argparse.Namespace:
    """Read the options without what roslaunch adds: ``own_name`` reads ``__name:=`` and ``__ns:=``, the rest has no effect."""
    parser = argparse.ArgumentParser(prog="ros_bridge", description="Bridges topics and services between ROS 1 and ROS 2.")
    add_arguments(parser)
    options = parser.parse_args([argument for argument in arguments if ":=" not in argument])
    if not (options.config or options.all or options.include or options.list):
        parser.error("nothing to bridge: give --config FILE, or --all, or --include PATTERN")
    options.all = options.all or (options.list and not options.config and not options.include)
    return options


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add all options to a parser."""
    parser.add_argument(
        "--config", type=Path, action="append", default=[], metavar="FILE", help="configuration (YAML); several files are merged"
    )
    discovery_options.add_arguments(parser)
    parser.add_argument("--list", action="store_true", help="print what would be bridged, and why the rest can't be, and exit")
    parser.add_argument(
        "--stats", type=Path, metavar="FILE", help="write figures of all routes to this JSON file, every 2 s and at the end"
    )


def ros2_namespace(arguments: Sequence[str]) -> str:
    """Return the namespace of the ROS 2 node, empty for the root; raises ConfigError."""
    told = [argument.removeprefix("__ns:=") for argument in arguments if argument.startswith("__ns:=")]
    try:
        return str(config_values.name(told[-1])) if told and told[-1] != "/" else ""
    except ValueError as expected:
        raise ConfigError(f"__ns:={told[-1]} is not {expected}") from None


def set_up_logging() -> None:
    """Log to standard error, from level INFO on."""
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("[%(levelname)s] ros_bridge: %(message)s"))
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    logger.propagate = False


def connect_master() -> Connection:
    """Return the connection to the master; raises ConfigError when ROS_MASTER_URI is no address.

    What the ROS 2 world does not set is filled in: the master, and loopback as our own address if the master is there.
    """
    master_uri = os.environ.setdefault("ROS_MASTER_URI", DEFAULT_MASTER)
    if master_uri.startswith(LOOPBACK) and "ROS_HOSTNAME" not in os.environ:
        os.environ.setdefault("ROS_IP", "127.0.0.1")
    try:
        return Connection(master_uri)
    except OSError as error:
        raise ConfigError(f"ROS_MASTER_URI: {error}") from error


def main(arguments: list[str]) -> int:
    """Run the bridge until SIGINT or SIGTERM; return 0, 1 when a type or the data plane is missing, 2 for bad options or no master."""
    set_up_logging()
    arguments, ros2_arguments = split_arguments(arguments)
    options = parse_arguments(arguments)
    stop = StopEvent()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    try:
        config = load_config(options.config, discovery_options.read_arguments(options), ros2_namespace(ros2_arguments))
    except BridgeError as error:
        logger.error("%s", error)
        return EXIT_CONFIG
    try:
        from ros_bridge.session import list_session, run_session  # rclpy takes its time, so options are checked first

        master, name = connect_master(), own_name(arguments)
        if options.list:
            sys.stdout.write(list_session(config, master, name))
        else:
            run_session(config, options.stats, stop, master, name, ros2_arguments, wait=bool(options.config))
    except (NoMasterError, ConfigError) as error:
        logger.error("%s", error)
        return EXIT_CONFIG
    except BridgeError as error:
        logger.error("%s", error)
        return EXIT_FAILED
    return EXIT_OK


def entry() -> None:
    """Run as a program. Threads that ask a peer which hangs would be waited for, so the process ends itself."""
    code = main(sys.argv[1:])
    sys.stderr.flush()
    sys.stdout.flush()
    os._exit(code)
