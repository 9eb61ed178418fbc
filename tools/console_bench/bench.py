"""`./alula bench console`: what the page's server costs a flight, and how long a viewer waits for a long one.

1. A record of hours, with a tree of 500 nodes: how long until the server has read it (``read_s``), and until a viewer that comes then has
   all of it (``caught_up_s``).
2. A flight that goes on at 20 entries a second, ten viewers and one that hangs: the server's share of a core, and how old an entry is
   when a viewer gets it.
3. A mission's process under way, beside ``--load`` processes that only compute: how long from a command on the socket until its answer, of
   the first one (``first_answer_s``) and of those that follow.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import psutil
from websockets.asyncio.client import ClientConnection, connect

from alula.common.files import write_json
from alula.common.network import claim_domain, free_port
from alula.common.processes import RUN_ID_VARIABLE
from alula.common.record import DATA, EVENTS, FILE, TREE, RecordWriter

QUICK_HOURS, QUICK_S = 0.5, 10.0
ROUNDS = 15
"""How often the mission is told to pause and to go on."""
APART_S = 0.2
"""A viewer may give ten commands a second."""
RUN_ID = "bench-console"


@dataclass(frozen=True)
class Figures:
    """What was measured; seconds of wall clock, parts of one core."""

    hours: float
    nodes: int
    entries: int
    record_mb: float
    read_s: float
    caught_up_s: float
    viewers: int
    rate_hz: float
    server_core: float
    age_p50_s: float
    age_p95_s: float
    server_rss_mb: float
    load: int
    first_answer_s: float
    answer_p50_s: float
    answer_max_s: float


def tree(nodes: int, busy: int) -> dict[str, Any]:
    """Return a tree of so many nodes, one of which runs."""
    leaves = [leaf(number, "RUNNING" if number == busy % (nodes - 1) else "SUCCESS") for number in range(nodes - 1)]
    return {**leaf(-1, "RUNNING"), "kind": "sequence", "children": leaves}


def leaf(number: int, status: str) -> dict[str, Any]:
    """Return a node without children."""
    return {"name": f"node {number}", "kind": "skill", "status": status, "message": "", "skill": f"s.skill_{number}", "children": []}


def entry(number: int, t_s: float, nodes: int) -> tuple[str, dict[str, Any]]:
    """Return the numbered entry of a run: mostly samples, now and then an event or a change of the tree."""
    if number % 50 == 0:
        return TREE, tree(nodes, number)
    if number % 10:
        value = {"position_enu_m": {"x": t_s, "y": 0.0, "z": 3.0}, "obstacle_m": 8.0, "mode": "GUIDED", "ready": True}
        return DATA, {"skillset": f"s{number % 4}", "data": "state", "value": value, "stamp_s": t_s}
    state = "RUNNING" if number % 20 else "TERMINATED"
    event = {"skillset": "s", "skill": "goto", "id": str(number // 20), "state": state, "kind": "EXECUTION", "sequence": number}
    return EVENTS, {
        **event,
        "stamp_s": t_s,
        "result": "ARRIVED" if state == "TERMINATED" else "",
        "message": "",
        "inputs": {},
        "outputs": {},
    }


def write_hours(writer: RecordWriter, hours: float, nodes: int) -> int:
    """Write a record of so many hours at 5 entries a second; return how many."""
    count = round(hours * 3600 * 5)
    for number in range(count):
        t_s = number / 5
        topic, value = entry(number, t_s, nodes)
        writer.write(topic, round(t_s * 1e9), value)
    return count


async def viewer(port: int) -> ClientConnection:
    """Connect as a page does."""
    socket = await connect(f"ws://127.0.0.1:{port}/feed", origin=f"http://127.0.0.1:{port}", max_size=None)  # type: ignore[arg-type]
    await socket.send('{"key": "bench"}')
    return socket


async def caught_up(port: int, last_s: float) -> ClientConnection:
    """Connect, and return when the run up to ``last_s``, seconds of mission clock, has come."""
    socket = await viewer(port)
    while True:
        entries = json.loads(await socket.recv()).get("entries", [])
        if any(t_s is not None and t_s >= last_s for _, t_s, _ in entries):
            return socket


async def wait_for_all(port: int, last_s: float) -> float:
    """Return how long a viewer waits until it has the run up to ``last_s``."""
    begun = time.perf_counter()
    await (await caught_up(port, last_s)).close()
    return time.perf_counter() - begun


async def listen(socket: ClientConnection, ages_s: list[float]) -> None:
    """Note how old each sample is when it comes."""
    async for message in socket:
        now = time.monotonic()
        for topic, _, value in json.loads(message).get("entries", []):
            if topic == DATA and "sent" in value:
                ages_s.append(now - value["sent"])


async def live(
    server: psutil.Process, port: int, writer: RecordWriter, last_s: float, options: argparse.Namespace
) -> tuple[float, list[float]]:
    """Write a run that goes on while viewers listen; return the server's part of a core, and how old entries were."""
    ages_s: list[float] = []
    sockets = [await caught_up(port, last_s) for _ in range(options.viewers)]
    hung = await viewer(port)  # never reads
    listening = [asyncio.create_task(listen(socket, ages_s)) for socket in sockets]
    begun, before_s = time.monotonic(), sum(server.cpu_times()[:2])
    for number in range(round(options.seconds * options.rate)):
        t_s = options.hours * 3600 + number / options.rate
        topic, value = entry(number, t_s, options.nodes)
        writer.write(topic, round(t_s * 1e9), {**value, "sent": time.monotonic()})
        await asyncio.sleep(max(0.0, begun + (number + 1) / options.rate - time.monotonic()))
    core = (sum(server.cpu_times()[:2]) - before_s) / (time.monotonic() - begun)
    for task in listening:
        task.cancel()
    for socket in [*sockets, hung]:
        socket.transport.abort()
    return core, ages_s


@contextlib.contextmanager
def served(folder: Path) -> Iterator[tuple[subprocess.Popen[bytes], int]]:
    """Serve the run in a folder; give the server and its port."""
    port = free_port()
    words = [sys.executable, "-m", "alula.cli.console", "--run", str(folder), "--port", str(port)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as server:
        try:
            if server.stdout is None or not server.stdout.readline():
                raise OSError("the server did not start")
            yield server, port
        finally:
            server.terminate()


@contextlib.contextmanager
def mission(folder: Path, load: int) -> Iterator[None]:
    """Run a mission in the folder, in a domain of its own, beside so many processes that take what they get of the processor."""
    folder.mkdir()
    with contextlib.ExitStack() as stack:
        claim = claim_domain()
        stack.callback(claim.release)
        environment = {**os.environ, RUN_ID_VARIABLE: RUN_ID, "ROS_DOMAIN_ID": str(claim.domain)}
        run = {"scenario": "bench", "domain": claim.domain, "run_id": RUN_ID}
        (folder / "run.json").write_text(json.dumps(run), encoding="utf-8")
        busy = [[sys.executable, "-c", "while True: pass"]] * load
        for words in [[sys.executable, "-m", "console_bench", str(folder)], *busy]:
            process = stack.enter_context(subprocess.Popen(words, env=environment, stderr=subprocess.DEVNULL))
            stack.callback(process.kill)
        yield


async def answered(socket: ClientConnection, command: str, run: str) -> tuple[float, str]:
    """Give a command; return how long its answer takes, and the answer."""
    begun = time.perf_counter()
    await socket.send(json.dumps({"command": command, "run": run}))
    while True:
        message = json.loads(await socket.recv())
        if message.get("command") == command and "answer" in message:
            return time.perf_counter() - begun, str(message["answer"])


async def command(port: int, run: str) -> tuple[float, list[float]]:
    """Have a mission pause and go on; return how long the first answer takes, and the others."""
    socket, ticked = await viewer(port), False
    while not ticked:
        ticked = any(topic == TREE for topic, _, _ in json.loads(await socket.recv()).get("entries", []))
    while not json.loads(await socket.recv()).get("status", {}).get("live"):
        pass
    first_s, _ = await answered(socket, "pause", run)
    waits_s = []
    for words in ["resume", "pause"] * ROUNDS:
        await asyncio.sleep(APART_S)
        waited_s, answer = await answered(socket, words, run)
        if answer.startswith("refused"):
            raise OSError(f"{words}: {answer}")
        waits_s.append(waited_s)
    await socket.close()
    return first_s, waits_s


def measure(folder: Path, options: argparse.Namespace) -> Figures:
    """Serve a record, and watch it; then command a mission."""
    writer = RecordWriter(folder / FILE)
    entries = write_hours(writer, options.hours, options.nodes)
    (folder / "run.json").write_text('{"scenario": "bench", "domain": 0, "run_id": "bench"}', encoding="utf-8")
    with served(folder) as (server, port):
        last_s = (entries - 10) / 5  # samples behind that may be thinned out
        read_s, caught_up_s = (asyncio.run(wait_for_all(port, last_s)) for _ in range(2))
        process = psutil.Process(server.pid)
        core, ages_s = asyncio.run(live(process, port, writer, last_s, options))
        rss_mb = process.memory_info().rss / 1e6
    run = folder / "mission"
    with mission(run, options.load), served(run) as (_, port):
        first_s, waits_s = asyncio.run(command(port, run.name))
    cuts = statistics.quantiles(ages_s, n=20) if len(ages_s) > 1 else [0.0] * 19
    size_mb = (folder / FILE).stat().st_size / 1e6
    return Figures(
        hours=options.hours,
        nodes=options.nodes,
        entries=entries,
        record_mb=round(size_mb, 1),
        read_s=round(read_s, 2),
        caught_up_s=round(caught_up_s, 2),
        viewers=options.viewers,
        rate_hz=options.rate,
        server_core=round(core, 3),
        age_p50_s=round(cuts[9], 3),
        age_p95_s=round(cuts[18], 3),
        server_rss_mb=round(rss_mb, 1),
        load=options.load,
        first_answer_s=round(first_s, 3),
        answer_p50_s=round(statistics.median(waits_s), 3),
        answer_max_s=round(max(waits_s), 3),
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print; return the exit code."""
    parser = argparse.ArgumentParser(prog="alula bench console", description="Measure what the operator's page costs a flight.")
    parser.add_argument("--hours", type=float, default=4.0, help="hours that the run has already lasted (default 4)")
    parser.add_argument("--nodes", type=int, default=500, help="nodes of the mission's tree (default 500)")
    parser.add_argument("--viewers", type=int, default=10, help="number of viewers (default 10)")
    parser.add_argument("--rate", type=float, default=20.0, help="entries a second meanwhile (default 20)")
    parser.add_argument("--seconds", type=float, default=30.0, help="seconds that the run goes on (default 30)")
    parser.add_argument("--load", type=int, default=0, help="processes that load the machine while the mission is commanded (default 0)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures to this file")
    parser.add_argument("--quick", action="store_true", help="half an hour of record, then 10 s: for a first look, not for comparing")
    options = parser.parse_args(arguments)
    if options.quick:
        options.hours, options.seconds = QUICK_HOURS, QUICK_S
    with tempfile.TemporaryDirectory(prefix="alula-bench-") as folder:
        figures = measure(Path(folder), options)
    for name, value in asdict(figures).items():
        sys.stdout.write(f"{name:15} {value}\n")
    if options.json is not None:
        write_json(options.json, asdict(figures))
    return 0


if __name__ == "__main__":
    sys.exit(main())
