"""MAVLink commands one after the other: sent, repeated when no answer comes, refused in the autopilot's own words.

An answer may be lost, and the command that is repeated be refused, because it has been obeyed. So what the vehicle is seen to do counts
more than any answer.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from uav_guidance.vehicle import Mode, VehicleSnapshot

DO_SET_MODE = 176
ARM_DISARM = 400
NAV_TAKEOFF = 22
FORCE_MAGIC = 21196.0  # param2 of ARM_DISARM

ACCEPTED = 0
IN_PROGRESS = 5
RESULT_NAMES = {1: "temporarily rejected", 2: "denied", 3: "unsupported", 4: "failed", 6: "cancelled"}

ANSWER_S = 0.5  # the autopilot answers within some 10 ms; the rest is the link's
ATTEMPTS = 8
PROGRESS_S = 1.0  # from an answer that says "in progress" to the next one
LIFT_OFF_S = 6.0  # from the command to lift-off, spooling up included; 5.4 s were seen
# The autopilot queues its texts: they may leave up to a few 100 ms after the answer that they explain.
TEXT_GRACE_S = 0.4
TEXT_LIMIT_S = 2.0  # for an autopilot that tells no time any more
WORST_SEVERITY_TOLD = 4  # WARNING; notices and infos are no reasons


@dataclass(frozen=True)
class Evidence:
    """How the vehicle shows that it has done what a command asks for."""

    kind: str
    """The MAVLink message that shows it."""
    seen: Callable[[VehicleSnapshot], bool]
    within_s: float = ANSWER_S
    """From the last attempt until it is given up."""


NO_EVIDENCE = Evidence("", lambda _vehicle: False)


@dataclass(frozen=True)
class Command:
    """A COMMAND_LONG of MAVLink, and what shows that the autopilot has carried it out."""

    name: str
    number: int
    parameters: tuple[float, float, float, float, float, float, float] = (0.0,) * 7
    confirmation: int = 0
    evidence: Evidence = NO_EVIDENCE
    known_obstacle: str = ""
    """Why it may be refused, known before it is sent: the reason where the autopilot refuses without a word."""


def set_mode(mode: Mode) -> Command:
    """Return the command to change the flight mode."""
    evidence = Evidence("HEARTBEAT", lambda vehicle: vehicle.mode == mode)
    return Command(f"mode {mode.name}", DO_SET_MODE, (1.0, float(mode), 0.0, 0.0, 0.0, 0.0, 0.0), evidence=evidence)


def arm(failing_check: str = "") -> Command:
    """Return the command to arm; a HEARTBEAT with the armed flag is evidence of it. ``failing_check``: the last text of a failed check."""
    evidence = Evidence("HEARTBEAT", lambda vehicle: vehicle.armed)
    return Command("arm", ARM_DISARM, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), evidence=evidence, known_obstacle=failing_check)


def disarm(*, force: bool = False) -> Command:
    """Return the command to disarm; what the autopilot takes for flying is only disarmed by ``force``."""
    parameters = (0.0, FORCE_MAGIC if force else 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    evidence = Evidence("HEARTBEAT", lambda vehicle: not vehicle.armed)
    return Command("disarm by force" if force else "disarm", ARM_DISARM, parameters, evidence=evidence)


def take_off(height_above_home_m: float) -> Command:
    """Return the command to climb to a height above home, metres."""
    evidence = Evidence("EXTENDED_SYS_STATE", lambda vehicle: vehicle.off_ground, within_s=LIFT_OFF_S)
    return Command("take-off", NAV_TAKEOFF, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, height_above_home_m), evidence=evidence)


@dataclass(frozen=True)
class Outcome:
    """Whether the autopilot accepted a procedure, and its reason where it did not."""

    accepted: bool
    reason: str = ""
    answered: bool = True
    """Whether it was the autopilot that accepted or refused."""


class Procedure:
    """Commands in order, the next one when the one before was accepted. Times are seconds of the mission clock."""

    def __init__(self, commands: Sequence[Command]) -> None:
        self.outcome: Outcome | None = None if commands else Outcome(accepted=True)
        self._commands = deque(commands)
        self._attempts = 0
        self._answer_until_s = 0.0
        self._refusal: tuple[float, int | None, str] | None = None
        self._boot_ms: int | None = None
        self._texts: list[str] = []

    def due(self, now_s: float) -> Command | None:
        """Return the command to send now, if any; call it at every step."""
        if self.outcome is not None or self._refused(now_s) or (self._attempts and now_s < self._answer_until_s):
            return None
        command = self._commands[0]
        if self._attempts == ATTEMPTS:
            self.abort(f"{command.name}: the autopilot does not answer")
            return None
        self._attempts += 1
        self._answer_until_s = now_s + (command.evidence.within_s if self._attempts == ATTEMPTS else ANSWER_S)
        return replace(command, confirmation=self._attempts - 1)

    def on_answer(self, number: int, result: int, now_s: float) -> None:
        """Handle a COMMAND_ACK; ignore one of a command that is not under way."""
        if self.outcome is not None or self._refusal is not None or not self._attempts or number != self._commands[0].number:
            return
        if result == IN_PROGRESS:
            self._answer_until_s = now_s + PROGRESS_S
        elif result == ACCEPTED:
            self._go_on()
        else:
            self._refusal = (now_s, self._boot_ms, RESULT_NAMES.get(result, f"result {result}"))

    def on_vehicle(self, kind: str, vehicle: VehicleSnapshot) -> None:
        """Handle the vehicle's state after a MAVLink message of this kind: a command that is obeyed needs no answer."""
        self._boot_ms = vehicle.boot_ms
        if self.outcome is not None or not self._attempts:
            return
        evidence = self._commands[0].evidence
        if evidence.kind == kind and evidence.seen(vehicle):
            self._go_on()

    def on_text(self, severity: int, text: str) -> None:
        """Handle a STATUSTEXT: what comes while a command is under way may be the reason for its refusal."""
        if self.outcome is None and self._attempts and severity <= WORST_SEVERITY_TOLD and text not in self._texts:
            self._texts.append(text)

    def abort(self, reason: str) -> None:
        """End the procedure as not accepted, if it has not ended."""
        if self.outcome is None:
            self.outcome = Outcome(accepted=False, reason=reason, answered=False)

    def _go_on(self) -> None:
        """Go on to the next command: this one was accepted, or the vehicle was seen to obey it."""
        self._commands.popleft()
        self._attempts = 0
        self._refusal = None
        self._texts.clear()
        if not self._commands:
            self.outcome = Outcome(accepted=True)

    def _refused(self, now_s: float) -> bool:
        """Return whether the command was refused; the outcome follows when the texts had time to arrive."""
        if self._refusal is None or self.outcome is not None:
            return False
        refused_s, refused_ms, result = self._refusal
        if now_s - refused_s >= TEXT_LIMIT_S or min(now_s - refused_s, self._heard_s(refused_ms)) >= TEXT_GRACE_S:
            words = "; ".join(self._texts) or self._commands[0].known_obstacle
            reason = f"{self._commands[0].name} {result}" + (f": {words}" if words else "")
            self.outcome = Outcome(accepted=False, reason=reason)
        return True

    def _heard_s(self, since_ms: int | None) -> float:
        """Return the autopilot's own time that was received since then: on a slow machine, what it has sent may wait to be read."""
        return TEXT_GRACE_S if since_ms is None or self._boot_ms is None else (self._boot_ms - since_ms) / 1e3
