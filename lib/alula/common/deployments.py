"""Where a robot's skills run on its own computers: ``deployments/NAME.yaml`` says it of each place (docs/how-to/on-the-robot.md)."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from ipaddress import ip_address
from pathlib import Path
from typing import TypeVar
from urllib.parse import urlsplit

from alula.common.deployment_names import FOLDER, names_in, why_no_deployment
from alula.common.errors import AlulaError
from alula.common.keys import Key
from alula.common.located_yaml import Located, choices, read_yaml
from alula.common.network import DOMAINS, NAMESPACE
from alula.common.robots import RobotError, RobotFolder, find_robot

LOOPBACK = "127.0.0.1"
PAGE_PORT, MAX_PORT = 8440, 65535
DISK_GB, MAX_DISK_GB = 20.0, 1e6
KEYS: Mapping[str, Key] = {
    "about": Key("a sentence"),
    "ros1": Key("the ROS 1 that runs already", "needed"),
    "ros2": Key("the ROS 2 of what runs here", "needed"),
    "managers": Key(
        "what makes the hooks of each skillset served here, `MODULE:FACTORY`; or a command, which has its own process", "none run here"
    ),
    "processes": Key(
        "`single`: one serves them, the part `managers`; `skillsets`: one each; `separate`: one for each skill, too", "`single`"
    ),
    "silence": Key("after how many seconds without its reporter a resource is unknown, as `{rover.link: 4}`", "as the model says"),
    "bridge": Key("its configuration: one that set-up generates, by its name, or a file", "it runs elsewhere"),
    "record": Key("what is recorded", "no recorder"),
    "page": Key("the operator's page", "no page"),
}
ROS1_KEYS: Mapping[str, Key] = {
    "master": Key("URI of the ROS 1 master that runs already", "needed"),
    "address": Key("this computer's address, as the base's nodes reach it", LOOPBACK),
}
ROS2_KEYS: Mapping[str, Key] = {
    "domain": Key("DDS domain", "0"),
    "discovery": Key("how far nodes look: `LOCALHOST`, `SUBNET` or `OFF`", "`LOCALHOST`"),
    "peers": Key("computers that are found without multicast", "none"),
    "namespace": Key("what names in ROS 2 begin with", "nothing"),
}
RECORD_KEYS: Mapping[str, Key] = {
    "topics": Key("topics of ROS 1, recorded all the time and in each mission", "no recorder"),
    "disk_gb": Key("1e9 bytes that all recordings and missions may take; what is oldest goes first", f"{DISK_GB:g}"),
}
PAGE_KEYS: Mapping[str, Key] = {
    "users": Key(
        "`here`: of this computer; `watchers`: others may watch; `operators`: others may command, over TLS, with a token", "`here`"
    ),
    "address": Key("this computer's, which others reach", LOOPBACK),
    "port": Key("of TCP", str(PAGE_PORT)),
}
SHORTEST_SILENCE_S, LONGEST_SILENCE_S = 1.0, 3600.0
"""Of a resource whose reporter is not heard of, in a model or a deployment; reporters beat twice a second."""
EnumT = TypeVar("EnumT", bound=Enum)
_WORD = re.compile(r"[a-z][a-z0-9_]*")
_TOPIC = re.compile(r"/[A-Za-z][A-Za-z0-9_/]*")
_FACTORY = re.compile(r"[A-Za-z_][A-Za-z0-9_.]*:[A-Za-z_][A-Za-z0-9_]*")
_HOST = re.compile(r"[A-Za-z0-9]([A-Za-z0-9.-]*[A-Za-z0-9])?")


class DeploymentError(AlulaError):
    """A deployment does not exist or its file is wrong; the message says where, and what would be right."""


class Discovery(Enum):
    """How far nodes of ROS 2 look for one another, as ``ROS_AUTOMATIC_DISCOVERY_RANGE`` has it."""

    LOCALHOST = "LOCALHOST"
    SUBNET = "SUBNET"
    OFF = "OFF"


class Processes(Enum):
    """In how many processes the managers run whose deployment or launch file names the makers of their hooks."""

    SINGLE = "single"  # all in one
    SKILLSETS = "skillsets"  # one for each skillset
    SEPARATE = "separate"  # one for each skillset and one for each of its skills


class PageUsers(Enum):
    """Who may use the operator's page."""

    HERE = "here"  # programs of this computer
    WATCHERS = "watchers"  # others may watch, without TLS
    OPERATORS = "operators"  # others may command, over TLS, with the address that holds the token


@dataclass(frozen=True)
class Page:
    """The operator's page: who may use it, and the address and TCP port that it listens on."""

    users: PageUsers = PageUsers.HERE
    address: str = LOOPBACK
    port: int = PAGE_PORT


@dataclass(frozen=True)
class Deployment:
    """What of a robot runs on this computer, beside which ROS 1 master, and in which DDS domain.

    Attributes:
        name: as on the command line.
        path: its file.
        about: in a sentence.
        master: URI of the ROS 1 master that runs already.
        address: this computer's, as the nodes of ROS 1 reach it: an IP address or a host's name.
        domain: DDS domain; 0 is what every program of ROS 2 has that is told nothing.
        discovery: how far nodes of ROS 2 look for one another.
        peers: addresses of computers that are found without multicast.
        namespace: what the robot's names in ROS 2 begin with, as ``/rover``; empty: nothing.
        managers: what serves each skillset here, by its name: the maker of its hooks, one word ``MODULE:FACTORY``, or the words of a
            command, which has a process of its own.
        processes: in how many processes managers run whose hooks' maker is named.
        silences: seconds after which a resource whose reporter is not heard of is unknown, by its name as ``rover.estop``, where this link
            needs another time than the model says.
        bridge: the bridge's configuration: one that set-up generates, by its name, or a file of the robot; empty: it runs elsewhere.
        topics: of ROS 1, recorded all the time and in each mission; none: there is no recorder.
        disk_gb: what the missions and recordings of this deployment may take together, 1e9 bytes.
        page: the operator's page; None: it is not served.
    """

    name: str
    path: Path
    about: str = ""
    master: str = "http://127.0.0.1:11311"
    address: str = LOOPBACK
    domain: int = 0
    discovery: Discovery = Discovery.LOCALHOST
    peers: tuple[str, ...] = ()
    namespace: str = ""
    managers: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    processes: Processes = Processes.SINGLE
    silences: Mapping[str, float] = field(default_factory=dict)
    bridge: str = ""
    topics: tuple[str, ...] = ()
    disk_gb: float = DISK_GB
    page: Page | None = None

    @property
    def served(self) -> Mapping[str, tuple[str, ...]]:
        """Return the skillsets that each process of managers serves, by the part's name."""
        together = tuple(name for name, words in self.managers.items() if self.processes is Processes.SINGLE and makes_hooks(words))
        return {**({MANAGERS: together} if together else {}), **{name: (name,) for name in self.managers if name not in together}}

    @property
    def parts(self) -> tuple[str, ...]:
        """Return the names of what runs here, in the order of the start."""
        return (
            *(["bridge"] if self.bridge else []),
            *self.served,
            *(["recorder"] if self.topics else []),
            *(["page"] if self.page else []),
        )


MANAGERS = "managers"
"""The part whose process serves all skillsets that have none of their own."""
RESERVED = ("bridge", MANAGERS, "recorder", "page", "mission")
"""Names of parts that no skillset can have."""


def makes_hooks(words: Sequence[str]) -> bool:
    """Return whether what serves a skillset is the maker of its hooks, and no command."""
    return len(words) == 1 and _FACTORY.fullmatch(words[0]) is not None


def deployment_names(robot: RobotFolder | None = None) -> list[str]:
    """Return the names of a robot's deployments; raises RobotError where none is named and there is no robot."""
    return names_in((robot or find_robot()).root)


def load_deployment(name: str, robot: RobotFolder | None = None) -> Deployment:
    """Read a deployment; raises DeploymentError."""
    try:
        root = (robot or find_robot()).root
    except RobotError as error:
        raise DeploymentError(str(error)) from None
    why = why_no_deployment(name, root)
    if why:
        raise DeploymentError(why)
    return read_deployment(root / FOLDER / f"{name}.yaml")


def read_deployment(path: Path) -> Deployment:
    """Read the file of a deployment; raises DeploymentError with file and line."""
    document = read_yaml(path, DeploymentError)
    if document is None:
        raise DeploymentError(f"{path}: is empty; a deployment needs `ros1` and `ros2`")
    said = document.record("a deployment", KEYS)
    for key in ("ros1", "ros2"):
        if key not in said:
            raise document.wrong(f"a deployment needs `{key}`")
    ros1, ros2 = said["ros1"].record("`ros1`", ROS1_KEYS), said["ros2"].record("`ros2`", ROS2_KEYS)
    record = said["record"].record("`record`", RECORD_KEYS) if "record" in said else {}
    if "master" not in ros1:
        raise said["ros1"].wrong("`ros1` needs `master`, as http://192.168.1.10:11311")
    deployment = Deployment(
        name=path.stem,
        path=path,
        about=said["about"].text("`about`") if "about" in said else "",
        master=_master(ros1["master"]),
        address=_host(ros1["address"], "`address`") if "address" in ros1 else LOOPBACK,
        domain=_whole(ros2["domain"], "`domain`", 0, DOMAINS[-1]) if "domain" in ros2 else 0,
        discovery=_one_of(Discovery, ros2["discovery"], "`discovery`") if "discovery" in ros2 else Discovery.LOCALHOST,
        peers=tuple(_host(one, "a peer") for one in ros2["peers"].elements()) if "peers" in ros2 else (),
        namespace=_namespace(ros2["namespace"]) if "namespace" in ros2 else "",
        managers=_managers(said["managers"]) if "managers" in said else {},
        processes=_one_of(Processes, said["processes"], "`processes`") if "processes" in said else Processes.SINGLE,
        silences=_silences(said["silence"], said.get("managers")) if "silence" in said else {},
        bridge=said["bridge"].text("`bridge`") if "bridge" in said else "",
        topics=tuple(_topic(one) for one in record["topics"].elements()) if "topics" in record else (),
        disk_gb=record["disk_gb"].number("`disk_gb`", 0.1, MAX_DISK_GB) if "disk_gb" in record else DISK_GB,
        page=_page(said["page"]) if "page" in said else None,
    )
    _check_reach(deployment, ros1, ros2)
    return deployment


def _check_reach(deployment: Deployment, ros1: Mapping[str, Located], ros2: Mapping[str, Located]) -> None:
    """Refuse what would start and never meet the other computer."""
    if not is_loopback(urlsplit(deployment.master).hostname or "") and is_loopback(deployment.address):
        place = ros1.get("address", ros1["master"])
        raise place.wrong(f"the master is on another computer, whose nodes can't reach {deployment.address}: `address` is this computer's")
    if deployment.peers and deployment.discovery is Discovery.LOCALHOST:
        raise ros2["peers"].wrong(
            "peers on other computers are not found with `discovery: LOCALHOST`; write SUBNET, or OFF for peers alone"
        )


def is_loopback(host: str) -> bool:
    """Return whether a host is this computer by an address that no other one reaches."""
    if host == "localhost":
        return True
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return False


def _one_of(kind: type[EnumT], part: Located, what: str) -> EnumT:
    text = part.text(what)
    known = [one.value for one in kind]
    if text not in known:
        raise part.wrong(f"{what} is not {text}; it may be {choices(text, known)}")
    return kind(text)


def _whole(part: Located, what: str, low: int, high: int) -> int:
    number = part.number(what, low, high)
    if number != int(number):
        raise part.wrong(f"{what} should be a whole number, not {number:g}")
    return int(number)


def _master(part: Located) -> str:
    text = part.text("`master`")
    try:
        parts = urlsplit(text)
        good = parts.scheme == "http" and bool(parts.hostname) and bool(parts.port) and parts.path in {"", "/"}
    except ValueError:
        good = False
    if not good:
        raise part.wrong(f"`master` should be the URI of a ROS master, as http://192.168.1.10:11311, not {text}")
    return text.rstrip("/")


def _host(part: Located, what: str) -> str:
    text = part.text(what)
    if _HOST.fullmatch(text) is None:
        raise part.wrong(f"{what} should be an IPv4 address or a host's name, not {text}")
    return text


def _topic(part: Located) -> str:
    text = part.text("a topic of `record`")
    if _TOPIC.fullmatch(text) is None:
        raise part.wrong(f"a topic of `record` should be a whole name, as /base/odom, not {text}")
    return text


def _namespace(part: Located) -> str:
    text = part.text("`namespace`").strip("/")
    if text and not NAMESPACE.fullmatch(f"/{text}"):
        raise part.wrong(f"`namespace` should be a name such as rover, of letters, digits and _, not {text}")
    return f"/{text}" if text else ""


def _managers(part: Located) -> dict[str, tuple[str, ...]]:
    found: dict[str, tuple[str, ...]] = {}
    for name, command in part.entries("`managers`").items():
        if _WORD.fullmatch(name) is None or name in RESERVED:
            raise command.wrong(f"`managers`: `{name}` names no skillset")
        try:
            words = shlex.split(command.text(f"the command of {name}"))
        except ValueError as error:
            raise command.wrong(f"the command of {name}: {error}") from None
        if not words:
            raise command.wrong(f"what serves {name} is empty; name the maker of its hooks, as my_robot.hooks:make_hooks")
        found[name] = tuple(words)
    return found


def _silences(part: Located, managers: Located | None) -> dict[str, float]:
    served = () if managers is None else tuple(managers.entries("`managers`"))
    found: dict[str, float] = {}
    for name, seconds in part.entries("`silence`").items():
        skillset, _, resource = name.partition(".")
        if _WORD.fullmatch(skillset) is None or not resource.isidentifier():
            raise seconds.wrong(f"`silence`: `{name}` names no resource; write SKILLSET.RESOURCE, as rover.estop")
        if skillset not in served:
            raise seconds.wrong(f"`silence`: the managers of {skillset} do not run here; here run {choices(skillset, served)}")
        found[name] = seconds.number(f"the silence of {name}", SHORTEST_SILENCE_S, LONGEST_SILENCE_S)
    return found


def _page(part: Located) -> Page:
    said = part.record("`page`", PAGE_KEYS)
    users = _one_of(PageUsers, said["users"], "`users`") if "users" in said else PageUsers.HERE
    address = _host(said["address"], "`address`") if "address" in said else LOOPBACK
    if is_loopback(address) is not (users is PageUsers.HERE):
        place = said.get("address", part)
        if users is PageUsers.HERE:
            raise place.wrong(f"with `users: here` the page listens on {LOOPBACK} only; let others in: `users: watchers` or `operators`")
        raise place.wrong(f"with `users: {users.value}` the page needs an `address` of this computer that others reach, not {address}")
    return Page(users, address, _whole(said["port"], "`port`", 1, MAX_PORT) if "port" in said else PAGE_PORT)
