"""A deployment's parts from outside: begin them, have some started again, end them, and tell how they are."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from pathlib import Path

from alula.common.deployments import Deployment, load_deployment
from alula.common.errors import AlulaError
from alula.common.files import write_json
from alula.common.robots import find_robot
from alula.language.fleet import load_models
from alula_flight.station import state as states
from alula_flight.station.contents import with_contents
from alula_flight.station.keeper import differences, end_all, read_wanted
from alula_flight.station.parts import Places, check_silences, parts_of, places_of
from alula_flight.station.state import StationState, living

UP_S, DOWN_S = 60.0, 120.0  # wall clock, until all parts have lived for a moment, and until all have ended
LOOK_S = 0.1
KEEPER_LOG = "keeper.log"
SETTLED = (states.RUNNING, states.REFUSED, states.GIVEN_UP)


class StationError(AlulaError):
    """What was asked for can't be done; the message says why, and what to do."""


class Station:
    """A deployment on this computer."""

    def __init__(self, name: str) -> None:
        robot = find_robot()
        self._robot = robot
        self.deployment: Deployment = load_deployment(name, robot)
        self.places: Places = places_of(self.deployment, robot)

    @property
    def folder(self) -> Path:
        """Return where its state lies."""
        return self.places.folder

    def state(self) -> StationState:
        """Return its state, where what is said to run does run."""
        state = StationState.load(self.folder)
        for part in state.parts.values():
            if part.pid and part.process is None:
                part.pid, part.state = 0, states.ENDED if not self.keeper_lives(state) else states.WAITING
        return state

    @staticmethod
    def keeper_lives(state: StationState) -> bool:
        """Return whether something keeps the parts up."""
        return living(state.keeper, state.keeper_start) is not None

    @property
    def is_up(self) -> bool:
        """Return whether something keeps its parts up."""
        return self.keeper_lives(StationState.load(self.folder))

    @property
    def mission(self) -> str:
        """Return the mission that runs, in words; empty: none."""
        return states.holder(self.folder / states.MISSION_LOCK)

    def begin(self, until: int = 0) -> None:
        """Have a keeper start what does not run; with ``until`` it ends with that process. Raises AlulaError."""
        self._check()
        self.places.logs.mkdir(parents=True, exist_ok=True)
        words = [sys.executable, "-m", "alula_flight.station.keeper", self.deployment.name, *([f"--until={until}"] if until else [])]
        log = self.places.logs / KEEPER_LOG
        with log.open("wb") as said:
            keeper = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=said, stderr=said, start_new_session=True)
        self._wait(lambda: self.is_up or keeper.poll() is not None, UP_S)
        if keeper.poll() is not None:
            lines = log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
            raise StationError(lines[-1].removeprefix("alula up: ") if lines else f"the keeper ended with {keeper.returncode}")

    def ask(self, restart: Iterable[str] = ()) -> None:
        """Have the keeper read the deployment again, start these parts again, and those that are down; raises AlulaError."""
        self._check()
        number = read_wanted(self.folder)[1] + 1
        write_json(self.folder / states.WANTED, {"restart": sorted(restart), "number": number})
        os.kill(StationState.load(self.folder).keeper, signal.SIGHUP)
        if not self._wait(lambda: StationState.load(self.folder).answered >= number, UP_S):
            raise StationError(f"the keeper has not answered within {UP_S:g} s; {self.places.logs / KEEPER_LOG} says what it does")

    def _check(self) -> None:
        if self.deployment.silences:
            check_silences(self.deployment, load_models(self._robot).skillsets)

    def differences(self) -> dict[str, list[str]]:
        """Say of each part that runs in what it differs from what it would be now; raises AlulaError where a model is wrong."""
        state = self.state()
        if not any(part.pid for part in state.parts.values()):
            return {}
        now = with_contents(parts_of(self.deployment, self.places, state.run_id, os.environ), self.deployment, self.places, self._robot)
        found = {part.name: differences(state.parts[part.name], part) for part in now if part.name in state.parts}
        return {name: how for name, how in found.items() if how and state.parts[name].pid}

    def settle(self) -> StationState:
        """Wait until each part has lived for a moment, or will not; return how they are."""
        self._wait(lambda: all(part.state in SETTLED for part in StationState.load(self.folder).parts.values()), UP_S)
        return self.state()

    def end(self) -> None:
        """End all parts and their keeper, or what a keeper that has died has left; raises StationError."""
        state = StationState.load(self.folder)
        keeper = living(state.keeper, state.keeper_start)
        if keeper is None:
            end_all(state)
            state.keeper = 0
            state.save(self.folder)
            return
        keeper.send_signal(signal.SIGTERM)
        if not self._wait(lambda: living(state.keeper, state.keeper_start) is None, DOWN_S):
            raise StationError(f"the keeper, process {state.keeper}, has not ended within {DOWN_S:g} s; end it, and ask again")

    @staticmethod
    def _wait(condition: Callable[[], bool], timeout_s: float) -> bool:
        end_s = time.monotonic() + timeout_s
        while not condition():
            if time.monotonic() > end_s:
                return False
            time.sleep(LOOK_S)
        return True
