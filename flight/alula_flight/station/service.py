"""``alula service``: have systemd keep a deployment up, as a unit of the user or of the system."""

from __future__ import annotations

import os
import pwd
import shlex
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from alula_flight.station.station import Station, StationError

STARTS, WITHIN_S, AGAIN_S, WATCHDOG_S, STOP_S = 5, 120, 2, 60, 120
"""How often the keeper is started anew and within how long; until it is, until it counts as hung, and how long its end may take."""
SYSTEM = Path("/etc/systemd/system")
BOOTED = Path("/run/systemd/system")
"""There where systemd runs the machine (sd_booted(3))."""
INSTALL, REMOVE, PRINT = "install", "remove", "print"
KEPT = ("ALULA_ROOT", "ALULA_STATE", "ALULA_ROBOT")


def unit_name(station: Station) -> str:
    """Return the unit's name: of the robot and the deployment."""
    return f"alula-{station.deployment.path.parent.parent.name}-{station.deployment.name}.service"


def unit(station: Station, user: str, environment: Mapping[str, str]) -> str:
    """Return the text of the unit; ``user``: whom it runs as where it is the system's, empty for one of the user."""
    robot = station.deployment.path.parent.parent
    set_up = [f"Environment={quoted(f'{name}={environment[name]}')}" for name in KEPT if environment.get(name)]
    keeper = [str(station.places.root / "setup/in_ros1"), "python3", "-m", "alula_flight.station.keeper", station.deployment.name]
    lines = [
        "[Unit]",
        f"Description=Alula's skills of {robot.name}, deployment {station.deployment.name}",
        *(["After=network-online.target", "Wants=network-online.target"] if user else []),
        f"StartLimitIntervalSec={WITHIN_S}",
        f"StartLimitBurst={STARTS}",
        "",
        "[Service]",
        "Type=notify",
        "NotifyAccess=main",
        *([f"User={user}"] if user else []),
        f"WorkingDirectory={escaped(str(robot))}",
        *set_up,
        f"ExecStart={' '.join(map(quoted, keeper))}",
        "ExecReload=/bin/kill -HUP $MAINPID",
        "Restart=on-failure",
        f"RestartSec={AGAIN_S}",
        "RestartPreventExitStatus=2",
        f"WatchdogSec={WATCHDOG_S}",
        # What a keeper that died or hung kept goes on, and the next one takes it over; one that is told to end ends it itself.
        "KillMode=process",
        f"TimeoutStopSec={STOP_S}",
        "",
        "[Install]",
        f"WantedBy={'multi-user.target' if user else 'default.target'}",
    ]
    return "".join(f"{line}\n" for line in lines)


def escaped(text: str) -> str:
    """Return a text that systemd takes as it is: it knows specifiers (systemd.unit(5))."""
    return text.replace("%", "%%")


def quoted(word: str) -> str:
    """Return a word of a command line of systemd (systemd.service(5)): quoted where it has to be, without variables."""
    plain = escaped(word).replace("$", "$$")
    return plain if shlex.quote(word) == word else '"' + plain.replace("\\", "\\\\").replace('"', '\\"') + '"'


def wanted(words: Sequence[str], *, told: bool) -> tuple[str, str]:
    """Return what is to be done and with which deployment; raises StationError."""
    if told and len(words) == 1:
        return PRINT, words[0]
    if not told and len(words) == 2 and words[0] in {INSTALL, REMOVE}:
        return words[0], words[1]
    raise StationError("it takes: install DEPLOYMENT, remove DEPLOYMENT, or --print DEPLOYMENT")


def service(given: Any) -> int:
    """Print, install or remove the unit; return 0. Raises StationError."""
    act, name = wanted(given.words, told=given.told)
    station = Station(name)
    system = bool(given.system)
    text = unit(station, pwd.getpwuid(os.getuid()).pw_name if system else "", os.environ)
    folder = SYSTEM if system else Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "systemd/user"
    path = folder / unit_name(station)
    if act == PRINT:
        sys.stdout.write(text)
        return 0
    control = ["systemctl", *([] if system else ["--user"])]
    if not BOOTED.is_dir() or shutil.which("systemctl") is None:
        raise StationError(f"systemd does not run on this computer; have its own init run: alula up {station.deployment.name}")
    if act == INSTALL:
        folder.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        _run([*control, "daemon-reload"])
        _run([*control, "enable", "--now", path.name])
        lingering = "" if system else "; it ends with your session unless you let it linger: loginctl enable-linger"
        sys.stderr.write(f"{path} is installed and started{lingering}\n")
    else:
        if not path.exists():
            raise StationError(f"there is no {path}; nothing was installed{'' if system else ', or for the system: --system'}")
        _run([*control, "disable", "--now", path.name])
        station.end()  # what a keeper that hung has left
        path.unlink()
        _run([*control, "daemon-reload"])
        sys.stderr.write(f"{path} is removed\n")
    return 0


def _run(words: list[str]) -> None:
    done = subprocess.run(words, check=False, capture_output=True, text=True)
    if done.returncode:
        raise StationError(f"{shlex.join(words)}: {done.stderr.strip() or f'ended with {done.returncode}'}")
