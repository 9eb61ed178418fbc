"""What runs for a deployment, as commands and environments; starts nothing."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from ipaddress import ip_address
from pathlib import Path

from alula.common.deployments import Deployment, DeploymentError, Discovery, PageUsers, Processes, makes_hooks
from alula.common.processes import NAMESPACE_VARIABLE, RUN_ID_VARIABLE
from alula.common.robots import RobotFolder
from alula.common.runs import up_folder
from alula.common.suggestions import nearest
from alula.model.model import Skillset

DEPLOYMENT_VARIABLE = "ALULA_DEPLOYMENT"
"""In the environment of a deployment's parts: its name, which ``alula run`` takes where none is given; so the page's missions fly on it."""
NOT_PASSED_ON = (
    *("ROS_IP", "ROS_HOSTNAME", "ROS_STATIC_PEERS", "ROS_LOCALHOST_ONLY", "ALULA_USUAL_MASTER", RUN_ID_VARIABLE, NAMESPACE_VARIABLE),
    *("NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"),
)
"""What the caller's shell says of another graph or run, and what systemd says to the keeper alone."""
PROFILE = "fastdds.xml"
BAG_MB, WHITELIST = 64, re.compile(r"<interfaceWhiteList>.*?</interfaceWhiteList>", re.DOTALL)


@dataclass(frozen=True)
class Part:
    """A process of a deployment: its name, its command, the environment that it has, and digests of its models, bindings and hooks."""

    name: str
    words: tuple[str, ...]
    environment: Mapping[str, str]
    contents: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Places:
    """Where a deployment's files lie.

    Attributes:
        root: Alula's checkout.
        robot: what the robot's set-up made.
        folder: of the deployment: its state, logs and recordings.
    """

    root: Path
    robot: Path
    folder: Path

    @property
    def logs(self) -> Path:
        """Return the folder of the parts' words."""
        return self.folder / "logs"

    @property
    def bags(self) -> Path:
        """Return the folder of what is recorded all the time."""
        return self.folder / "bags"

    def in_ros1(self, *words: str) -> tuple[str, ...]:
        """Return a command of the ROS 1 world."""
        return (str(self.root / "setup/in_ros1"), *words)

    def in_ros2(self, node: str, *words: str) -> tuple[str, ...]:
        """Return a command of the ROS 2 world, as roslaunch would start it: it knows its namespace, and the node's name."""
        return (str(self.root / "ros1_ws/src/skillset_ros1/scripts/in_ros2"), *words, f"__name:={node}")


def places_of(deployment: Deployment, robot: RobotFolder) -> Places:
    """Return where its files lie, by what the entry script has said of the installation."""
    root = Path(os.environ["ALULA_ROOT"])
    state = Path(os.environ.get("ALULA_ROBOT_STATE") or robot.root / ".alula")
    return Places(root, state, up_folder() / deployment.name)


def environment_of(deployment: Deployment, places: Places, caller: Mapping[str, str]) -> dict[str, str]:
    """Return the environment of every process of a deployment: the caller's, in the graph that the deployment names."""
    kept = {name: value for name, value in caller.items() if name not in NOT_PASSED_ON}
    own = "ROS_IP" if _is_address(deployment.address) else "ROS_HOSTNAME"
    graph = {
        "ROS_MASTER_URI": deployment.master,
        own: deployment.address,
        "ROS_DOMAIN_ID": str(deployment.domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": deployment.discovery.value,
        "ROS_HOME": str(places.logs),
        "ROS_LOG_DIR": str(places.logs),
        DEPLOYMENT_VARIABLE: deployment.name,
        **({"ROS_STATIC_PEERS": ";".join(deployment.peers)} if deployment.peers else {}),
        **({NAMESPACE_VARIABLE: deployment.namespace} if deployment.namespace else {}),
    }
    if deployment.discovery is not Discovery.LOCALHOST:
        graph["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(places.folder / PROFILE)
    return {**kept, **graph}


def network_profile(deployment: Deployment, loopback_only: str) -> str:
    """Return Fast DDS's profile for a graph over several computers, from the one that binds to loopback only.

    It binds to this computer's address, too; where that is a name, to all interfaces.
    """
    addresses = f"<address>127.0.0.1</address><address>{deployment.address}</address>"
    return WHITELIST.sub(f"<interfaceWhiteList>{addresses}</interfaceWhiteList>" if _is_address(deployment.address) else "", loopback_only)


def parts_of(deployment: Deployment, places: Places, run_id: str, caller: Mapping[str, str]) -> list[Part]:
    """Return what runs here, in the order of its start; raises DeploymentError where the bridge's configuration is not there.

    All but the page carry ``run_id``: the missions that the page starts are not the deployment's to end.
    """
    plain = environment_of(deployment, places, caller)
    ours = {**plain, RUN_ID_VARIABLE: run_id}
    parts = []
    if deployment.bridge:
        stats = str(places.logs / "bridge.json")
        words = ("python", "-m", "ros_bridge", "--config", str(bridge_file(deployment, places)), "--stats", stats)
        parts.append(Part("bridge", places.in_ros2("ros_bridge", *words), ours))
    parts += [Part(name, places.in_ros2(name, *manager_words(deployment, name)), ours) for name in deployment.served]
    if deployment.topics:
        parts.append(
            Part("recorder", places.in_ros1(*recording(places.bags / deployment.name, deployment.topics, all_the_time=True)), ours)
        )
    if deployment.page is not None:
        page = deployment.page
        plainly = ["--plain"] if page.users is PageUsers.WATCHERS else []
        console = ("python", "-m", "skill_panel.console", "--host", page.address, "--port", str(page.port), *plainly)
        parts.append(Part("page", (str(places.root / "setup/in_ros2"), *console), plain))
    return parts


def manager_words(deployment: Deployment, part: str) -> list[str]:
    """Return the command of a process of managers; it is told the silences that the deployment gives its resources."""
    skillsets, commands = deployment.served[part], deployment.managers
    words = list(commands[skillsets[0]])
    if makes_hooks(words):
        words = ["python", "-m", "skillset_ros2.managers", *(f"{name}={commands[name][0]}" for name in skillsets)]
        words += ["--processes", "separate"] if deployment.processes is Processes.SEPARATE else []
    given = {name: s for name, s in deployment.silences.items() if name.partition(".")[0] in skillsets}
    return [*words, *(["--ros-args", *(word for name, s in given.items() for word in ("-p", f"silence.{name}:={s!r}"))] if given else [])]


def check_silences(deployment: Deployment, skillsets: Iterable[Skillset]) -> None:
    """Refuse silences of what has none in the model: nothing could follow them; raises DeploymentError."""
    known = [f"{skillset.name}.{one.name}" for skillset in skillsets for one in skillset.resources if one.silence_s is not None]
    for name in deployment.silences:
        if name not in known:
            hint = nearest(name, known) or "no resource has one"
            raise DeploymentError(f"{deployment.path}: `silence`: {name} has no `silence` in its model; {hint}")


def recording(path: Path, topics: Sequence[str], *, all_the_time: bool) -> tuple[str, ...]:
    """Return the command that records topics of ROS 1: into ``path``, or all the time into files that begin so, of `BAG_MB` each."""
    where = ("--split", f"--size={BAG_MB}", "-o", str(path)) if all_the_time else ("-O", str(path))
    return ("rosbag", "record", "--chunksize=64", *where, *topics)


def bridge_file(deployment: Deployment, places: Places) -> Path:
    """Return the bridge's configuration: a file of the robot, or one that set-up has generated; raises DeploymentError."""
    robot = deployment.path.parent.parent
    for path in (robot / deployment.bridge, places.robot / "generated" / deployment.bridge):
        if path.is_file():
            return path
    made = ", ".join(sorted(path.name for path in (places.robot / "generated").glob("*_bridge.yaml"))) or "none"
    raise DeploymentError(
        f"{deployment.path}: `bridge`: there is no {deployment.bridge} in the robot's folder, nor among what set-up has generated ({made})"
    )


def _is_address(host: str) -> bool:
    try:
        ip_address(host)
    except ValueError:
        return False
    return True
