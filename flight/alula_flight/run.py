"""The front of a live ``alula run``: checks the request, starts the supervisor, shows what happens, and never leaves anything running.

1. read the command line                  4. when it is over, end whatever is left of the run
2. claim folder, ports and DDS domain     5. make the report from what was recorded
3. start the supervisor and watch         6. say how it went
"""

from __future__ import annotations

import contextlib
import functools
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import psutil

from alula.cli.run_request import shown_at
from alula.common.errors import AlulaError
from alula.common.network import DOMAINS, DomainClaim, NoFreeDomainError, NoFreePortError, claim_domain
from alula.common.processes import NAMESPACE_VARIABLE, RUN_ID_VARIABLE, die_with_parent, end_run, ends_within, node_name, processes_of_run
from alula.common.scenarios import load_scenario
from alula.common.shared_memory import sweep_shared_memory
from alula.common.signals import Interrupts
from alula.records.conformance import Monitor
from alula.records.models import models_of
from alula.report.aborts import FRONT, ReportedAbort, aborted_by_signal, note_abort
from alula.report.deaths import Death, describe_exit, note_death
from alula.report.live import LiveEvents
from alula.runtime.live.part import part_of_robot
from alula.runtime.live.spec import FILE, RequestError, RunSpec
from alula_flight.attaching import attached_to, leave_at_rest
from alula_flight.command_line import check_no_master, parse, with_claim
from alula_flight.console_page import console_page
from alula_flight.members import members_of, reports_of
from alula_flight.outcome import CANNOT_START, GIVEN_UP, finish

MISSION_TIMEOUT_S = 150.0  # wall clock; to bring the robot to rest
TIMEOUT_S = 3.0  # wall clock, for what is left of a run to end by itself
LOOK_S = 0.2  # wall clock; how often it is looked what is new
MISSION_NODE = "mission"
STOPPING = "stopping: the robot comes to rest first; Ctrl-C again ends everything at once"


def own_graph(spec: RunSpec) -> dict[str, str]:
    """Return the environment of a run with a graph of its own."""
    out = Path(spec.out_dir)
    return {
        **os.environ,
        RUN_ID_VARIABLE: spec.run_id,
        "ROS_MASTER_URI": f"http://127.0.0.1:{spec.master_port}",
        "ROS_IP": "127.0.0.1",
        "ROS_HOME": str(out / "logs"),
        "ROS_LOG_DIR": str(out / "logs"),
        "ROS_DOMAIN_ID": str(spec.domain),
        NAMESPACE_VARIABLE: spec.namespace,
    }


def start_supervisor(spec: RunSpec, graph: Mapping[str, str], claim: DomainClaim | None) -> subprocess.Popen[bytes]:
    """Start the supervisor in a session of its own, so that a Ctrl-C reaches the front only; it shares the claim."""
    out = Path(spec.out_dir)
    module = "alula_flight.attached" if spec.deployment else "alula_flight.supervisor"
    with (out / "logs" / "supervisor.log").open("wb") as log:
        return subprocess.Popen(
            [sys.executable, "-m", module, str(out / FILE)],
            env=graph,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            pass_fds=[] if claim is None else [lock.fileno() for lock in claim.locks],
            preexec_fn=die_with_parent,  # noqa: PLW1509  (one prctl, no allocation)
        )


class Front:
    """Watches the supervisor; the first Ctrl-C has the robot come to rest, the second ends everything at once."""

    def __init__(
        self,
        spec: RunSpec,
        start: Callable[[], subprocess.Popen[bytes]],
        say: Callable[[str], None],
        monitor: Monitor | None = None,
    ) -> None:
        self._spec = spec
        self._start = start
        self._say = say
        self._monitor = monitor
        self._members = members_of(spec)
        self._interrupts = Interrupts(self._stop, lambda: say("ending everything at once"))
        self._supervisor: subprocess.Popen[bytes] | None = None

    def run(self) -> int:
        """Run the supervisor to its end and return the mission's exit code; the run's processes are gone afterwards.

        Of a fleet, the robots' runs first, and afterwards to their ends; raises RequestError where one of these could not begin.
        """
        self._interrupts.install()
        try:
            why_not = self._members.begin(lambda: self._interrupts.asked)
            if why_not:
                raise RequestError(why_not)
            if self._interrupts.asked:
                return CANNOT_START
            return self._run()
        finally:
            self._members.end(self._say, lambda: self._interrupts.at_once)

    def _run(self) -> int:
        supervisor = self._supervisor = self._start()
        live = LiveEvents(Path(self._spec.out_dir), self._say, self._monitor)
        try:
            while supervisor.poll() is None and not self._interrupts.at_once:
                live.show_new()
                self._members.look()
                ends_within(supervisor, LOOK_S)
            if supervisor.poll() is not None and supervisor.returncode < 0:
                self._supervisor_died(supervisor.returncode, live)
            live.show_new()
        finally:
            # At the second Ctrl-C the run is ended at once: a supervisor that is told politely would still bring the robot to rest.
            end_run(self._spec.run_id, timeout_s=0.0 if self._interrupts.at_once else TIMEOUT_S)
            supervisor.wait()
            sweep_shared_memory()
        return supervisor.returncode if supervisor.returncode in {0, GIVEN_UP, CANNOT_START} else GIVEN_UP

    def _stop(self) -> None:
        self._say(STOPPING)
        note_abort(Path(self._spec.out_dir), aborted_by_signal(self._interrupts.first))
        if self._supervisor is not None and self._supervisor.poll() is None:
            self._supervisor.send_signal(signal.SIGINT)

    def _supervisor_died(self, code: int, live: LiveEvents) -> None:
        """Let the mission bring the robot to rest; it lives in a session of its own and knows nothing of its parents."""
        out = Path(self._spec.out_dir)
        note_death(out, Death("supervisor", describe_exit(code), None))
        note_abort(out, ReportedAbort(FRONT, "the supervisor died"))
        self._say("the supervisor died; the mission brings the robot to rest")
        missions = [process for process in processes_of_run(self._spec.run_id) if node_name(process) == MISSION_NODE]
        for mission in missions:
            with contextlib.suppress(psutil.NoSuchProcess):
                mission.send_signal(signal.SIGINT)
        end = time.monotonic() + MISSION_TIMEOUT_S
        while missions and time.monotonic() < end and not self._interrupts.at_once:
            _, missions = psutil.wait_procs(missions, timeout=0.2)
            live.show_new()


def main(arguments: list[str]) -> int:
    """Run; return 0 accomplished, 1 given up, 2 could not start."""
    try:
        part = part_of_robot()
        request = parse(arguments, part)
        if request.deployment:
            with attached_to(request, tell) as graph:
                return fly(request, (), functools.partial(start_supervisor, request, graph, None))
        check_no_master(os.environ)
        claim = claim_domain([request.domain] if request.domain else DOMAINS, request.namespace)
        spec = with_claim(request, claim, part)
        return fly(spec, part.words(spec), functools.partial(start_supervisor, spec, own_graph(spec), claim))
    except (AlulaError, NoFreeDomainError, NoFreePortError) as error:
        sys.stderr.write(f"alula run: {error}\n")
        return CANNOT_START


def tell(line: str) -> None:
    """Say a line before the run has begun, on standard error."""
    sys.stderr.write(f"{line}\n")


def fly(spec: RunSpec, words: Sequence[str], start: Callable[[], subprocess.Popen[bytes]]) -> int:
    """Make the folder, run, and report; return the exit code. Raises RequestError."""
    out = Path(spec.out_dir)
    try:
        (out / "logs").mkdir(parents=True)
        spec.save(out / FILE)
    except OSError as error:
        raise RequestError(f"can't make the folder {out}: {error.strerror}; choose another with --out") from None
    say = announce(spec)
    for line in ([shown_at(spec.groot)] if spec.groot else []) + list(words):
        say(line)
    monitor = monitor_of(spec)
    with console_page(out, say) if spec.console else contextlib.nullcontext():
        code = Front(spec, start, say, monitor).run()
        if spec.deployment:
            leave_at_rest(spec, say)
        say("making the report")
        code = finish(spec, code, monitor)
        sys.stdout.write("".join(f"  {line}\n" for line in reports_of(spec)))
        return code


def monitor_of(spec: RunSpec) -> Monitor | None:
    """Return what holds the events against the models of the scenario's skillsets, where that was asked for."""
    return Monitor(models_of(load_scenario(spec.scenario).skillsets)) if spec.monitor else None


def announce(spec: RunSpec) -> Callable[[str], None]:
    """Say what is going to be run; return what says a line with the seconds since then."""
    started = time.monotonic()

    def say(line: str) -> None:
        sys.stderr.write(f"[{time.monotonic() - started:5.1f} s] {line}\n")
        sys.stderr.flush()

    failing = f", failing {', '.join(spec.faults)}" if spec.faults else ""
    place = f", on {spec.deployment}" if spec.deployment else f", in {spec.namespace} of DDS domain {spec.domain}" if spec.namespace else ""
    say(f"running '{spec.scenario}', seed {spec.seed}{failing}{place}; results in {spec.out_dir}")
    return say


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
