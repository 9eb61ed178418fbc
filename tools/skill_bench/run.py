"""One run of the benchmark: managers and client of each case, and beside them, block by block, bare rclpy."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from alula.common.network import claim_domain
from skill_bench.cases import Case
from skill_bench.clients import follow_bare, follow_skills
from skill_bench.figures import Load, Measured, Samples, idle_percent, join, times_of
from skill_bench.processes import Child, usage
from skill_bench.servers import serve_bare, serve_managers

Say = Callable[[str], None]


@dataclass(frozen=True)
class Effort:
    """How much is measured: blocks of so many of each kind, and the seconds (wall clock) in which nothing happens.

    ``warm`` of each kind come first and do not count: they load and discover.
    """

    blocks: int
    number: int
    idle_s: float
    warm: int = 5


FULL, QUICK, LEAST = Effort(3, 25, 6.0), Effort(2, 10, 2.0), Effort(1, 3, 0.5, warm=1)


@dataclass(frozen=True)
class Bench:
    """A DDS domain with bare rclpy in it, to measure cases beside."""

    domain: int
    server: Child
    client: Child
    say: Say

    def measure(self, case: Case, effort: Effort) -> Measured:
        """Measure a case in two processes of its own, which are gone afterwards."""
        with ExitStack() as stack:
            self.say(f"{case.name}: starts")
            managers = stack.enter_context(Child(f"managers of {case.name}", self.domain, serve_managers, case))
            managers.ask("ready")
            client = stack.enter_context(Child(f"client of {case.name}", self.domain, follow_skills, case))
            client.ask("ready")
            self._block(client, effort.warm)
            blocks = []
            for index in range(effort.blocks):
                self.say(f"{case.name}: {effort.number} of each, block {index + 1} of {effort.blocks}")
                blocks.append(self._block(client, effort.number))
            self.say(f"{case.name}: idle for {effort.idle_s:g} s")
            load = rest(managers, effort.idle_s)
        return Measured(case.name, case.skills, case.resources, times_of(join(blocks)), load)

    def idle(self, effort: Effort) -> Load:
        """Return what the bare server takes while nothing happens."""
        return rest(self.server, effort.idle_s)

    def _block(self, client: Child, number: int) -> Samples:
        """Measure so many of each kind, one kind after another, in the same few seconds."""
        return join([client.ask("stop", number), self._goals(number), client.ask("lose", number), self._topic(number)])

    def _goals(self, number: int) -> Samples:
        samples: Samples = self.client.ask("goals", number)
        return samples

    def _topic(self, number: int) -> Samples:
        self.client.order("topic", number)
        self.server.ask("publish", number)
        samples: Samples = self.client.answer()
        return samples


def rest(server: Child, idle_s: float) -> Load:
    """Return what a process takes over a time of wall clock in which nothing is asked of it."""
    begin_s, before = time.monotonic(), usage(server.pid)
    time.sleep(idle_s)
    after = usage(server.pid)
    return Load(after.rss_mb, idle_percent(before.cpu_s, after.cpu_s, time.monotonic() - begin_s))


@contextmanager
def open_bench(say: Say) -> Iterator[Bench]:
    """Claim a domain and serve bare rclpy in it until the block is left; then all processes are gone."""
    claim = claim_domain()
    try:
        with Child("bare server", claim.domain, serve_bare) as server, Child("bare client", claim.domain, follow_bare) as client:
            client.ask("ready")
            server.ask("ready")
            yield Bench(claim.domain, server, client, say)
    finally:
        claim.release()
