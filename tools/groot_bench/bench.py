"""`./alula bench groot [--json FILE]`: what it costs the mission that its tree is watched.

One tree is ticked alone, with a server and its log, and with viewers that ask for statuses and blackboards as often as Groot2 does, by
turns, so that what else the machine does falls on all alike. Told of each: a tick's time of the clock, and the mission thread's time of
the processor. Viewers are processes of their own.
"""

from __future__ import annotations

import argparse
import multiprocessing
import statistics
import struct
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from multiprocessing.synchronize import Event
from pathlib import Path

import zmq

from alula.common.files import write_json
from alula.trees.answers import WORDS, Answers, StepClock, scripted_tree
from alula.trees.groot.address import Address
from alula.trees.groot.protocol import PROTOCOL, Request
from alula.trees.groot.server import Server
from alula.trees.groot.watching import Watch
from alula.trees.reading import read_text
from alula.trees.standard import standard_registry
from alula.trees.tree import Tree

BRANCHES = 8
TREE = """<root BTCPP_format="4" main_tree_to_execute="Main">
    <BehaviorTree ID="Main"><Parallel failure_count="-1">{branches}</Parallel></BehaviorTree>
    <BehaviorTree ID="Branch"><KeepRunningUntilFailure><Sequence>
        <Script code="count:=1; twice:=count*2"/> <a/> <Fallback><Inverter><b/></Inverter><b/></Fallback>
        <ScriptCondition code="twice &gt; count"/>
    </Sequence></KeepRunningUntilFailure></BehaviorTree></root>"""
MANY = 1000
REST_S = 0.002
"""Between ticks, so that viewers have their turn as they have between the ticks of a mission."""


@dataclass
class Way:
    """How the tree is watched, and what its ticks took."""

    name: str
    clock_us: list[float] = field(default_factory=list)
    processor_us: list[float] = field(default_factory=list)

    def row(self) -> dict[str, object]:
        """Return what is told of it."""
        cuts = statistics.quantiles(self.clock_us, n=100)
        figures = {"median_us": cuts[49], "p95_us": cuts[94], "p99_us": cuts[98], "processor_us": statistics.mean(self.processor_us)}
        return {"way": self.name, "ticks": len(self.clock_us), **{name: round(value, 1) for name, value in figures.items()}}


def made() -> Tree:
    """Return a tree of eight branches that run side by side; in each a leaf runs for a few ticks and the next one begins."""
    branches = "".join(f'<SubTree ID="Branch" name="branch {number}"/>' for number in range(BRANCHES))
    script = {"a": ["RUNNING"] * 9 + ["SUCCESS"], "b": ["SUCCESS", *["RUNNING"] * 9, "SUCCESS"]}
    answers = Answers({leaf: [WORDS[word] for word in words] * MANY for leaf, words in script.items()})
    return scripted_tree(read_text(TREE.format(branches=branches)), standard_registry(), answers, StepClock())


def view(address: Address, rate_hz: float, boards: str, watching: Event, over: Event) -> None:
    """Ask for what a viewer shows, while it watches; run in a process of its own."""
    socket = zmq.Context().socket(zmq.REQ)
    socket.connect(f"tcp://{address.host}:{address.port}")
    number = 0
    while not over.wait(1 / rate_hz):
        if not watching.is_set():
            continue
        for request, *more in ((Request.STATUS,), (Request.BLACKBOARD, boards.encode())):
            number += 1
            socket.send_multipart([struct.pack("<BBI", PROTOCOL, request.value, number), *more])
            socket.recv_multipart()


def run(way: Way, tree: Tree, ticks: int, watch: Watch | None = None) -> None:
    """Tick and measure."""
    for _ in range(ticks):
        time.sleep(REST_S)
        begun, worked = time.perf_counter_ns(), time.thread_time_ns()
        tree.tick()
        if watch is not None:
            watch.commit()
        way.clock_us.append((time.perf_counter_ns() - begun) / 1000)
        way.processor_us.append((time.thread_time_ns() - worked) / 1000)


def measure(viewers: int, rate_hz: float, rounds: int, ticks: int) -> list[Way]:
    """Measure the ways by turns."""
    alone, watched = made(), made()
    ways = [Way("alone"), Way("server and log"), Way(f"{viewers} viewers")]
    clock_us = lambda: time.monotonic_ns() // 1000  # noqa: E731
    with tempfile.TemporaryDirectory() as folder:
        watch = Watch(watched, clock_us)
        watch.log(Path(folder) / "run.btlog")
        server = Server(watch.shown, Address(port=0))
        boards = ";".join(subtree.path or subtree.tree_id for subtree in watched.subtrees)
        spawn = multiprocessing.get_context("spawn")
        watching, over = spawn.Event(), spawn.Event()
        processes = [spawn.Process(target=view, args=(server.address, rate_hz, boards, watching, over)) for _ in range(viewers)]
        for process in processes:
            process.start()
        try:
            for _ in range(rounds):
                run(ways[0], alone, ticks)
                run(ways[1], watched, ticks, watch)
                watching.set()
                run(ways[2], watched, ticks, watch)
                watching.clear()
        finally:
            over.set()
            for process in processes:
                process.join()
            server.close()
            watch.close()
    return ways


def main(words: Sequence[str] | None = None) -> int:
    """Measure; print a table, and write JSON where it is wanted."""
    parser = argparse.ArgumentParser(prog="alula bench groot", description="Measure what it costs the mission that its tree is watched.")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write what was measured to this file, too")
    parser.add_argument("--viewers", type=int, default=5, metavar="N", help="(5)")
    parser.add_argument("--rate", type=float, default=20.0, metavar="HZ", help="how often each asks (20)")
    parser.add_argument("--rounds", type=int, default=10, metavar="N", help="turns of each way (10)")
    parser.add_argument("--ticks", type=int, default=200, metavar="N", help="of a turn (200)")
    given = parser.parse_args(words)
    rows = [way.row() for way in measure(given.viewers, given.rate, given.rounds, given.ticks)]
    sys.stdout.write(_HEAD + "\n" + "".join(_ROW.format(**row) + "\n" for row in rows))
    if given.json is not None:
        write_json(given.json, {"nodes": len(made().nodes), "rate_hz": given.rate, "ways": rows})
    return 0


_HEAD = f"{'way':<16}{'ticks':>8}{'median us':>12}{'p95 us':>10}{'p99 us':>10}{'CPU us':>10}"
_ROW = "{way:<16}{ticks:>8}{median_us:>12}{p95_us:>10}{p99_us:>10}{processor_us:>10}"


if __name__ == "__main__":
    sys.exit(main())
