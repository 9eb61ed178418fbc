"""`./alula console`: serve the operator's page until told to end.

Ends with 0, and with 2 when what was asked for can't be.
"""

from __future__ import annotations

import argparse
import asyncio
import functools
import os
import secrets
import signal
import socket
import ssl
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from alula.cli.options.live import DOMAINS, PORT
from alula.cli.table import parser_of
from alula.common.errors import AlulaError
from alula.common.network import free_port
from alula.common.robots import RobotFolder, load_robot_folder
from alula.common.runs import LATEST, Run, find_deployment, live_runs
from alula.console.admission import Admission, is_loopback
from alula.console.certificates import fingerprint, own_certificate, server_context
from alula.console.link import ActError, Link, Mission, Skillsets
from alula.console.server import Console
from alula.runtime.live.options import ask_offer


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Return the command line's values; wrong ones print the usage on stderr and exit with code 2."""
    parser = parser_of("console")
    options: argparse.Namespace = parser.parse_args(arguments)
    if options.domain is not None and options.domain not in DOMAINS:
        parser.error(f"--domain {options.domain}: a DDS domain is a number from 0 to {DOMAINS[-1]}")
    if options.port is not None and not 0 < options.port < 2**16:
        parser.error(f"--port {options.port}: a port is a number from 1 to {2**16 - 1}")
    if (options.certificate is None) != (options.key is None):
        parser.error("--certificate and --key belong together: give both, or none")
    if options.plain and options.certificate is not None:
        parser.error("--plain serves without TLS, so it takes no --certificate")
    return options


def tls_of(options: argparse.Namespace) -> tuple[ssl.SSLContext | None, str]:
    """Return the TLS to serve with, and the fingerprint of a certificate that signs itself; None and nothing for plain HTTP.

    Raises:
        ValueError, OSError: the certificate or its key can't be used.
    """
    if options.certificate is not None:
        return server_context(options.certificate, options.key), ""
    if options.plain or is_loopback(options.host):
        return None, ""
    own = own_certificate(Path(os.environ.get("ALULA_STATE") or Path(os.environ["ALULA_ROOT"], ".alula")) / "console")
    return server_context(own, own), fingerprint(own)


def first_run(options: argparse.Namespace) -> Path | None:
    """Return the run that is shown first; None: the newest.

    Raises:
        ValueError: there is no such run.
        AlulaError: there is no such deployment, or it is down.
    """
    if options.domain is not None:
        found = next((run.folder for run in live_runs() if run.domain == options.domain), None)
        if found is None:
            raise ValueError(f"--domain {options.domain}: no run is under way there; start one (alula run SCENARIO), or leave it out")
        return found
    if options.on is not None:
        return find_deployment(options.on).folder
    if options.run == LATEST:
        return None
    folder = Path(options.run).expanduser().absolute()
    if not (folder / "run.json").is_file():
        raise ValueError(f"--run {options.run}: is no run's folder, it has no run.json")
    return folder


def robots_beside(options: argparse.Namespace) -> list[RobotFolder]:
    """Return the robots whose runs are shown beside those of the robot that the console is about.

    Raises:
        RobotError: a folder holds no robot.
        ValueError: two could not be told apart.
    """
    robots = [load_robot_folder(folder.expanduser().resolve()) for folder in options.beside]
    names = [robot.name for robot in robots]
    if len(set(names)) < len(names):
        raise ValueError(f"--beside: robots are told apart by their names, and these are {', '.join(names)}")
    return robots


def port_of(options: argparse.Namespace) -> int:
    """Return the port to listen on."""
    if options.port is not None:
        return int(options.port)
    with socket.socket(socket.AF_INET6 if ":" in options.host else socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((options.host, PORT))
        except OSError:
            return free_port()
    return PORT


async def serve_until_told(console: Console, admission: Admission, known_by: str) -> None:
    """Serve until SIGINT, SIGTERM or SIGHUP."""
    told = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        asyncio.get_running_loop().add_signal_handler(number, told.set)
    async with console.open():
        sys.stdout.write(f"{admission.address}\n")
        sys.stdout.flush()
        if known_by:
            sys.stderr.write(f"the certificate is self-signed; check that the browser shows this SHA-256 fingerprint: {known_by}\n")
        sys.stderr.write("the operator's page is served there; Ctrl-C ends the server, not a run\n")
        await told.wait()


class LateLink:
    """The link to robots, made when one is reached first: a server that only shows runs needs no ROS."""

    def __init__(self, make: Callable[[], Link]) -> None:
        self._make = functools.cache(make)

    def connect(self, run: Run) -> Mission:
        """Return the mission of a run."""
        return self._make().connect(run)

    def listen(self, run: Run) -> Skillsets:
        """Return the skillsets of a run."""
        return self._make().listen(run)


def no_link() -> Link:
    """Raise ActError: without ROS 2 no robot can be reached."""
    raise ActError("there is no ROS 2 here: this server only shows runs")


def main(arguments: Sequence[str] | None = None, make_link: Callable[[], Link] = no_link) -> int:
    """Serve; return the exit code. ``make_link`` makes what reaches robots."""
    options = parse(arguments)
    try:
        fixed = first_run(options)
        token = "" if is_loopback(options.host) else secrets.token_urlsafe(24)
        tls, known_by = tls_of(options)
        admission = Admission(options.host, port_of(options), token, tls)
        console = Console(admission, LateLink(make_link), fixed=fixed, beside=robots_beside(options), ask_offer=ask_offer)
        asyncio.run(serve_until_told(console, admission, known_by))
    except (ValueError, OSError, AlulaError) as error:
        sys.stderr.write(f"alula console: {error}\n")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
