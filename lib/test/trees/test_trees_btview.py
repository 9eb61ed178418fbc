"""btview, a viewer that others have written, attached to a tree that is ticked."""

from __future__ import annotations

import json
import subprocess
import sys
import threading

import pytest

pytest.importorskip("zmq")
pytest.importorskip("btview")

from alula.trees.answers import WORDS, Answers, StepClock, scripted_tree
from alula.trees.groot.address import Address
from alula.trees.groot.server import Server
from alula.trees.groot.watching import Watch
from alula.trees.reading import read_text
from alula.trees.standard import standard_registry

TICKS_HZ = 20.0
MANY = 10_000
TREE = """<root BTCPP_format="4" main_tree_to_execute="Main">
    <BehaviorTree ID="Main"><Sequence name="work">
        <Script code="height:=12.5"/> <SubTree ID="Part" height="{height}"/> <b name="the b"/>
    </Sequence></BehaviorTree>
    <BehaviorTree ID="Part"><a speed="{height}"/></BehaviorTree></root>"""


class Rig:
    def __init__(self) -> None:
        self.clock = StepClock()
        answers = Answers({"a": [WORDS["RUNNING"], WORDS["SUCCESS"]] * MANY, "the b": [WORDS["RUNNING"], WORDS["FAILURE"]] * MANY})
        self.tree = scripted_tree(read_text(TREE), standard_registry(), answers, self.clock)
        self.watch = Watch(self.tree, lambda: self.clock() // 1000)
        self.server = Server(self.watch.shown, Address(port=0))

    def tick(self) -> None:
        self.tree.tick()
        self.watch.commit()

    def command(self, *words: str) -> list[str]:
        return [sys.executable, "-m", "btview", *words, "--no-color", "--ascii", "--timeout", "20", "--port", str(self.server.address.port)]

    def btview(self, *words: str) -> str:
        done = subprocess.run(self.command(*words), capture_output=True, text=True, check=False, timeout=60)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout


@pytest.fixture
def rig():
    rig = Rig()
    yield rig
    rig.server.close()


def statuses(snapshot: str) -> dict[str, str]:
    """Return the status of each node by its uid."""
    rows = [line.split("#")[1].split() for line in snapshot.splitlines() if "#" in line]
    return {row[0]: row[-1] for row in rows}


def test_a_snapshot_shows_names_ports_and_statuses(rig):
    assert set(statuses(rig.btview("snapshot", "--uid")).values()) == {"IDLE"}
    rig.tick()
    snapshot = rig.btview("snapshot", "--uid", "--ports")
    assert statuses(snapshot) == {"1": "RUNNING", "2": "SUCCESS", "3": "RUNNING", "4": "RUNNING", "5": "IDLE"}
    for words in ("work [Sequence]", "the b [b]", "code=height:=12.5", "speed={height}", "height={height}"):
        assert words in snapshot


def test_blackboards_are_read_by_the_names_of_subtrees(rig):
    rig.tick()
    names = [subtree.path or subtree.tree_id for subtree in rig.tree.subtrees]
    assert json.loads(rig.btview("blackboard", "--json", *names)) == {"Main": {"height": 12.5}, "Part::3": None}


def test_changes_are_followed_while_it_is_ticked(rig):
    over = threading.Event()

    def fly() -> None:
        while not over.wait(1 / TICKS_HZ):
            rig.tick()

    mission = threading.Thread(target=fly)
    follow = subprocess.Popen(rig.command("echo", "--json", "--poll-hz", "100"), stdout=subprocess.PIPE, text=True)
    mission.start()
    try:
        wanted = {("a", "RUNNING"), ("the b [b]", "RUNNING"), ("work [Sequence]", "RUNNING")}
        while wanted:
            change = json.loads(follow.stdout.readline())
            wanted.discard((change["node"], change["to"]))
    finally:
        over.set()
        mission.join()
        follow.kill()
        follow.communicate()


def test_several_watch_at_once(rig):
    rig.tick()
    viewers = [subprocess.Popen(rig.command("snapshot", "--uid"), stdout=subprocess.PIPE, text=True) for _ in range(3)]
    shown = [viewer.communicate(timeout=60)[0] for viewer in viewers]
    assert [statuses(one) for one in shown] == [statuses(shown[0])] * 3
