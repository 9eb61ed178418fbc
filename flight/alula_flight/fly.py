"""The front of ``./alula fly``: checks the request, starts the supervisor, shows what happens, and never leaves anything running.

1. read the command line                  4. when it is over, end whatever is left of the run
2. claim folder, ports and DDS domain     5. make the report from what was recorded
3. start the supervisor and watch         6. say how it went
"""

from __future__ import annotations

import argparse
import contextlib
import ctypes
import os
import shutil
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import psutil
from radio_link.kernel import KernelError
from radio_link.kernel import check as check_kernel
from radio_link.kernel import remove as remove_namespaces
from radio_link.netem import Radio

from alula_common.network import DomainClaim, NoFreeDomainError, claim_domain, free_port
from alula_common.processes import RUN_ID_VARIABLE, end_run, node_name, processes_of_run
from alula_common.scenarios import Scenario, load_scenario, scenario_names
from alula_common.shared_memory import sweep_shared_memory
from alula_common.signals import Interrupts
from alula_flight.beside import page_beside
from alula_flight.deaths import Death, DeathRecord, describe_exit, read_deaths
from alula_flight.live import LiveEvents
from alula_flight.mocked import CANNOT_START, STOPPING, MockFront
from alula_flight.spec import RequestError, RunSpec, read_faults, read_imperfections, read_scenario, read_sensors, read_world
from run_analysis.conformance import Monitor
from run_analysis.models import models_of
from uav_simulator.sensors.faults import FAULTS
from uav_simulator.world.config import world_names

FAULT = "WHAT[:HOW][@SECONDS[-SECONDS]]"
GIVEN_UP = 1
PR_SET_PDEATHSIG = 1  # prctl(2)
MISSION_PATIENCE_S = 150.0  # wall clock; stop, hover, land
PATIENCE_S = 3.0  # wall clock, for what is left of a run to end by itself
MISSION_NODE = "mission"
SENSORS_MB_S = 4.0  # stereo pair, LiDAR and IMU, compressed; measured in the yard


class Arguments(argparse.Namespace):
    """The command line of ``fly``."""

    scenario: str
    fail: list[str]
    out: Path | None
    seed: int
    rate: float | None
    world: str | None
    autopilot: str | None
    sensors: str | None
    imperfections: str
    mock: bool
    console: bool
    record: str
    monitor: bool
    netem: bool
    behaviour: list[Path]


def _parser() -> argparse.ArgumentParser:
    """Return the options of ``alula fly``."""
    parser = argparse.ArgumentParser(prog="alula fly", description="Fly a scenario through the whole stack.", add_help=True)
    parser.add_argument("scenario", help=f"what to fly: {', '.join(scenario_names())}")
    parser.add_argument("--fail", action="append", default=[], metavar=FAULT, help="break a sensor, seconds after lift-off")
    parser.add_argument(
        "--world", metavar="FILE|NAME", help=f"where to fly: a file, or {', '.join(world_names())} (default: the scenario's)"
    )
    parser.add_argument("--out", type=Path, help="folder for the results (default: runs/<time>-<scenario>)")
    parser.add_argument("--seed", type=int, default=0, help="seed of world details, wind and noise (default 0)")
    parser.add_argument("--rate", type=float, help="simulated seconds per second at most, 0: no limit (default 1)")
    parser.add_argument("--autopilot", metavar="URL", help="fly a real autopilot (pymavlink connection) instead of the simulator")
    parser.add_argument(
        "--sensors",
        metavar="simulated|followed:URL",
        help="with --autopilot, simulated ones. simulated: ArduPilot flies the simulator's body (its JSON interface); "
        "followed:URL: they are where the autopilot says over a second MAVLink connection",
    )
    parser.add_argument(
        "--imperfections",
        default="off",
        metavar="off|realistic|NAME=VALUE,...",
        help="of the simulated autopilot and sensors (default off)",
    )
    parser.add_argument("--console", action="store_true", help="serve the operator's page beside the flight")
    parser.add_argument("--mock", action="store_true", help="fly over mocks in virtual time: no simulator, no ROS graph, seconds")
    parser.add_argument(
        "--behaviour", action="append", default=[], type=Path, metavar="FILE", help="what the mocks do, on top of the drone's own"
    )
    parser.add_argument(
        "--record", choices=["functional", "sensors"], default="functional", help="sensors: functional.bag also holds raw measurements"
    )
    parser.add_argument(
        "--netem", action="store_true", help="let the kernel be the radio: namespaces, tbf and netem, as root, in real time"
    )
    parser.add_argument("--monitor", action="store_true", help="hold every event of the skillsets against the models, while it flies")
    return parser


def parse(arguments: list[str]) -> RunSpec:
    """Turn the command line into a specification; raise RequestError, or exit 2 as argparse does."""
    given = _parser().parse_args(arguments, namespace=Arguments())
    scenario = read_scenario(given.scenario)
    if not 0 <= given.seed < 2**31:
        raise RequestError(f"--seed {given.seed}: must lie between 0 and {2**31 - 1}")
    if given.rate is not None and not 0 <= given.rate <= 1000:  # also refuses nan
        raise RequestError(f"--rate {given.rate:g}: must be 0 (no limit) or a positive factor up to 1000")
    check_autopilot(given)
    check_mock(given)
    check_netem(given, scenario)
    return RunSpec(
        scenario=given.scenario,
        out_dir=str(run_folder(given.out, given.scenario)),
        run_id=uuid.uuid4().hex,
        seed=given.seed,
        rate=1.0 if given.rate is None else given.rate,
        faults=read_faults(given.fail, {**FAULTS, **dict(scenario.faults)}, others=given.mock),
        world=read_world(given.world or scenario.world),
        autopilot=given.autopilot,
        sensors=read_sensors(given.sensors or ""),
        imperfections=read_imperfections(given.imperfections),
        master_port=0 if given.mock else free_port(),
        mavlink_port=0 if given.mock else free_port(),
        domain=0,
        mock=given.mock,
        console=given.console,
        record=given.record,
        monitor=given.monitor,
        netem=given.netem,
        behaviour=tuple(str(path.expanduser().absolute()) for path in given.behaviour),
    )


def check_autopilot(given: Arguments) -> None:
    """Refuse what does not go together with another autopilot, or without one."""
    if given.sensors is not None and given.autopilot is None:
        raise RequestError("--sensors says what a real autopilot has for sensors; add --autopilot URL")
    if given.autopilot is None or given.sensors is not None:
        return
    if given.fail:
        raise RequestError("--fail breaks simulated sensors; with --autopilot there are none, unless --sensors simulated is added")
    if given.imperfections != "off":
        raise RequestError("--imperfections are those of simulated sensors; with --autopilot there are none")


def check_mock(given: Arguments) -> None:
    """Refuse what does not go together with mocks, or without them."""
    if given.behaviour and not given.mock:
        raise RequestError("--behaviour says what mocks do; add --mock")
    if given.mock and given.autopilot is not None:
        raise RequestError("--mock flies without a vehicle; leave out --autopilot")
    if given.mock and given.record == "sensors":
        raise RequestError("--record sensors: mocks measure nothing; leave it out with --mock")
    if given.mock and given.console:
        raise RequestError("--console: a flight over mocks is over in a moment; look at its report.html")
    if given.mock and given.rate is not None:
        raise RequestError("--mock flies in virtual time, which no --rate limits; leave it out")


def check_netem(given: Arguments, scenario: Scenario) -> None:
    """Refuse a kernel's radio where there is no radio, where time is not the wall's, and where the kernel can't."""
    if not given.netem:
        return
    if "radio" not in dict(scenario.faults):
        raise RequestError(f"--netem: the scenario {given.scenario} has no radio; leave it out")
    if given.mock or given.rate not in {None, 1.0}:
        raise RequestError(f"--netem shapes in real time: leave out {'--mock' if given.mock else f'--rate {given.rate:g}'}")
    try:
        check_kernel()
    except KernelError as error:
        raise RequestError(f"--netem: {error}") from None


def run_folder(wanted: Path | None, scenario: str) -> Path:
    """Return an absolute path that holds no run yet; raise RequestError if the wanted one does."""
    if wanted is not None:
        folder = wanted.expanduser().absolute()
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise RequestError(f"--out {wanted}: exists and is not an empty folder; choose another, a run never overwrites")
        return folder
    base = Path(os.environ["ALULA_ROOT"]) / "runs" / f"{datetime.now(tz=UTC).astimezone():%Y%m%d-%H%M%S}-{scenario}"
    candidates = (base, *(base.with_name(f"{base.name}-{n}") for n in range(2, 1000)))
    return next(folder for folder in candidates if not folder.exists())


def _die_with_parent() -> None:
    """Ask the kernel for SIGTERM when the front dies; runs in the supervisor between fork and exec."""
    ctypes.CDLL(None, use_errno=True).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)


def start_supervisor(spec: RunSpec, spec_path: Path, claim: DomainClaim) -> subprocess.Popen[bytes]:
    """Start the supervisor in a session of its own, so that a Ctrl-C reaches the front only; it shares the claim."""
    out = Path(spec.out_dir)
    environment = {
        **os.environ,
        RUN_ID_VARIABLE: spec.run_id,
        "ROS_MASTER_URI": f"http://127.0.0.1:{spec.master_port}",
        "ROS_IP": "127.0.0.1",
        "ROS_HOME": str(out / "logs"),
        "ROS_LOG_DIR": str(out / "logs"),
        "ROS_DOMAIN_ID": str(spec.domain),
    }
    with (out / "logs" / "supervisor.log").open("wb") as log:
        return subprocess.Popen(
            [sys.executable, "-m", "alula_flight.supervisor", str(spec_path)],
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            pass_fds=(claim.lock.fileno(),),
            preexec_fn=_die_with_parent,  # noqa: PLW1509  (one prctl, no allocation)
        )


class Front:
    """Watches the supervisor; the first Ctrl-C lands the vehicle, the second ends everything at once."""

    def __init__(self, spec: RunSpec, claim: DomainClaim, say: Callable[[str], None], monitor: Monitor | None = None) -> None:
        self._spec = spec
        self._claim = claim
        self._say = say
        self._monitor = monitor
        self._interrupts = Interrupts(self._land, lambda: say("ending everything at once"))
        self._supervisor: subprocess.Popen[bytes] | None = None

    def fly(self, spec_path: Path) -> int:
        """Run the supervisor to its end and return the mission's exit code; the run's processes are gone afterwards."""
        self._interrupts.install()
        supervisor = self._supervisor = start_supervisor(self._spec, spec_path, self._claim)
        live = LiveEvents(Path(self._spec.out_dir), self._say, self._monitor)
        try:
            while supervisor.poll() is None and not self._interrupts.at_once:
                live.show_new()
                with contextlib.suppress(subprocess.TimeoutExpired):
                    supervisor.wait(0.2)
            if supervisor.poll() is not None and supervisor.returncode < 0:
                self._supervisor_died(supervisor.returncode, live)
            live.show_new()
        finally:
            # At the second Ctrl-C the run is ended at once: a supervisor that is told politely would still try to land.
            end_run(self._spec.run_id, patience_s=0.0 if self._interrupts.at_once else PATIENCE_S)
            supervisor.wait()
            sweep_shared_memory()
            if self._spec.netem:
                remove_namespaces(Radio(self._spec.radio_port))
        return supervisor.returncode if supervisor.returncode in {0, GIVEN_UP, CANNOT_START} else GIVEN_UP

    def _land(self) -> None:
        self._say(STOPPING)
        if self._supervisor is not None and self._supervisor.poll() is None:
            self._supervisor.send_signal(signal.SIGINT)

    def _supervisor_died(self, code: int, live: LiveEvents) -> None:
        """Let the mission land the vehicle; it lives in a session of its own and knows nothing of its parents."""
        record = DeathRecord(Path(self._spec.out_dir) / "deaths.jsonl")
        record.add(Death("supervisor", describe_exit(code), None))
        self._say("the supervisor died; the mission lands the vehicle")
        missions = [process for process in processes_of_run(self._spec.run_id) if node_name(process) == MISSION_NODE]
        for mission in missions:
            with contextlib.suppress(psutil.NoSuchProcess):
                mission.send_signal(signal.SIGINT)
        end = time.monotonic() + MISSION_PATIENCE_S
        while missions and time.monotonic() < end and not self._interrupts.at_once:
            _, missions = psutil.wait_procs(missions, timeout=0.2)
            live.show_new()


def finish(spec: RunSpec, mission_exit: int | None, monitor: Monitor | None = None) -> int:
    """Make the report from the run's folder, say how it went, and return the exit code."""
    # Late, because a wrong command line should not have to wait for matplotlib and Open3D.
    from alula_flight.report.facts import RunFacts
    from alula_flight.report.making import make_report
    from alula_flight.verdict import verdict_lines

    out = Path(spec.out_dir)
    died = read_deaths(out / "deaths.jsonl")
    summary = make_report(
        RunFacts(
            scenario=spec.scenario,
            seed=spec.seed,
            out_dir=out,
            faults=list(spec.faults),
            died=[{"name": d.name, "when_s": d.when_s, "how": d.how} for d in died],
            mission_exit=mission_exit,
            mock=spec.mock,
            conformance=None if monitor is None else monitor.verdict.as_dict(),
        )
    )
    for line in verdict_lines(summary, died, out):
        sys.stdout.write(line + "\n")
    return mission_exit if mission_exit is not None else GIVEN_UP


def main(arguments: list[str]) -> int:
    """Fly; return 0 accomplished, 1 given up, 2 could not start."""
    try:
        request = parse(arguments)
        if request.mock:
            return fly_mocked(request)
        claim = claim_domain()
    except (RequestError, NoFreeDomainError) as error:
        sys.stderr.write(f"alula fly: {error}\n")
        return CANNOT_START
    spec = RunSpec(**{**request.__dict__, "domain": claim.domain})
    out = Path(spec.out_dir)
    try:
        (out / "logs").mkdir(parents=True)
    except OSError as error:
        sys.stderr.write(f"alula fly: can't make the folder {out}: {error.strerror}; choose another with --out\n")
        return CANNOT_START
    spec_path = out / "run.json"
    spec.save(spec_path)
    say = announce(spec)
    if spec.record == "sensors":
        say(sensors_words(out))
    monitor = monitor_of(spec)
    with page_beside(out, say) if spec.console else contextlib.nullcontext():
        code = Front(spec, claim, say, monitor).fly(spec_path)
        say("making the report")
        return finish(spec, code, monitor)


def monitor_of(spec: RunSpec) -> Monitor | None:
    """Return what holds the events against the models of the scenario's skillsets, where that was asked for."""
    return Monitor(models_of(load_scenario(spec.scenario).skillsets)) if spec.monitor else None


def sensors_words(out: Path) -> str:
    """Return how much the raw measurements will take, and how much there is."""
    free_gb, minutes_gb = shutil.disk_usage(out).free / 1e9, 120 * SENSORS_MB_S / 1e3
    return (
        f"functional.bag will hold raw measurements: about {SENSORS_MB_S:g} MB a second of flight, {minutes_gb:.1f} GB for two minutes; "
        f"{free_gb:.0f} GB are free, and the last one is left alone"
    )


def fly_mocked(spec: RunSpec) -> int:
    """Fly over mocks; raise RequestError when that can't be, and leave nothing behind then."""
    say = announce(spec)
    monitor = monitor_of(spec)
    code, words = MockFront(spec, say, monitor).fly()
    out = Path(spec.out_dir)
    if code == CANNOT_START and not (out / "mission.json").exists():
        raise RequestError(words.strip() or "the mission could not start")
    try:
        spec.save(out / "run.json")
        (out / "logs").mkdir(exist_ok=True)
        (out / "logs" / "mission.log").write_text(words, encoding="utf-8")
    except OSError as error:
        say(f"{error.filename} could not be written: {error.strerror}")
    say("making the report")
    return finish(spec, code, monitor)


def announce(spec: RunSpec) -> Callable[[str], None]:
    """Say what is going to be flown; return what says a line with the seconds since then."""
    started = time.monotonic()

    def say(line: str) -> None:
        sys.stderr.write(f"[{time.monotonic() - started:5.1f} s] {line}\n")
        sys.stderr.flush()

    failing = f", failing {', '.join(spec.faults)}" if spec.faults else ""
    say(f"flying '{spec.scenario}'{' over mocks' if spec.mock else ''}, seed {spec.seed}{failing}; results in {spec.out_dir}")
    return say


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
