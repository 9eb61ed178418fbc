"""BehaviorTree.CPP itself beside our server and our log, for the same trees and answers: the same bytes but for the times."""

from __future__ import annotations

import struct
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

pytest.importorskip("zmq")
pytest.importorskip("behaviortreepy")

import behaviortreepy
from trees_viewer import Viewer

from alula.common.network import free_port
from alula.trees.answers import WORDS, Answers, StepClock, scripted_tree
from alula.trees.groot.address import Address
from alula.trees.groot.btlog import LogError, read_log
from alula.trees.groot.server import Server
from alula.trees.groot.watching import Watch
from alula.trees.reading import read_text
from alula.trees.standard import standard_registry
from alula.trees.status import NAMES
from alula_testing.waits import until

TICKS = 12
TREES = {
    "controls": """
        <BehaviorTree ID="Main"><Sequence name="all &lt;x&gt; &amp; &quot;y&quot;">
            <Script code="x:=1; text:='hey'; far:=2.5"/>
            <Fallback><a/><b name="the b"/></Fallback>
            <Parallel failure_count="2"><a/><b/><ReactiveFallback><c/><AlwaysFailure/></ReactiveFallback></Parallel>
            <Inverter><AlwaysFailure/></Inverter>
        </Sequence></BehaviorTree>""",
    "decorators": """
        <BehaviorTree ID="Main"><ReactiveSequence>
            <ForceSuccess><a/></ForceSuccess>
            <Repeat num_cycles="2"><RetryUntilSuccessful num_attempts="3"><b/></RetryUntilSuccessful></Repeat>
            <RunOnce><AlwaysSuccess/></RunOnce>
            <KeepRunningUntilFailure><c/></KeepRunningUntilFailure>
        </ReactiveSequence></BehaviorTree>""",
    "subtrees": """
        <BehaviorTree ID="Main"><SequenceWithMemory>
            <Script code="n:=3; wanted:=true"/>
            <SubTree ID="Part" n="{n}"/>
            <SubTree ID="Part" name="again" n="{n}" _autoremap="true"/>
        </SequenceWithMemory></BehaviorTree>
        <BehaviorTree ID="Part"><Sequence><a/><Script code="n:=n+1; here:='x'"/><SubTree ID="Inner"/></Sequence></BehaviorTree>
        <BehaviorTree ID="Inner"><IfThenElse><b/><c/><AlwaysSuccess/></IfThenElse></BehaviorTree>""",
    "conditions": """
        <BehaviorTree ID="Main"><Sequence>
            <Script code="n:=0"/>
            <a _skipIf="n==1" _onSuccess="n+=1" _onFailure="n+=1"/>
            <b _successIf="n==2" _post="n+=1"/>
            <WhileDoElse>
                <ScriptCondition code="n&lt;4"/> <c _while="n&lt;9" _onHalted="n:=0"/> <AlwaysFailure _failureIf="false"/>
            </WhileDoElse>
        </Sequence></BehaviorTree>""",
}
SCRIPT = {"a": ["RUNNING", "SUCCESS", "FAILURE"], "b": ["SUCCESS", "RUNNING", "FAILURE", "SUCCESS"], "c": ["RUNNING", "RUNNING", "SUCCESS"]}


class Oracle:
    """BehaviorTree.CPP with its own publisher and log."""

    def __init__(self, text: str, folder: Path) -> None:
        factory = behaviortreepy.BehaviorTreeFactory()
        given: dict[str, int] = {}

        def answer(node):
            number = given[node.name()] = given.get(node.name(), -1) + 1
            script = SCRIPT[node.name().removeprefix("the ")]
            return getattr(behaviortreepy.NodeStatus, script[min(number, len(script) - 1)])

        for leaf in SCRIPT:
            factory.register_simple_stateful_action(leaf, answer, answer, lambda _node: None)
        port = free_port()
        self.tree = factory.create_tree_from_text(text)
        self.publisher = behaviortreepy.Groot2Publisher(self.tree, port)
        self.path = folder / "oracle.btlog"
        self.log = behaviortreepy.FileLogger(self.tree, str(self.path))
        self.viewer = Viewer(Address(port=port))

    def tick(self) -> str:
        return self.tree.tick_exactly_once().name

    def close(self) -> None:
        self.viewer.socket.close()
        self.tree.halt_tree()  # while its leaves' functions are still there
        del self.publisher
        del self.log


class Ours:
    """The same, ours."""

    def __init__(self, text: str, folder: Path) -> None:
        self.clock = StepClock()
        clock_us = lambda: self.clock() // 1000  # noqa: E731
        names = {**SCRIPT, "the b": SCRIPT["b"]}
        answers = Answers(
            {name: [WORDS[word] for word in script] for name, script in names.items() if f'"{name}"' in text or f"<{name}" in text}
        )
        self.tree = scripted_tree(read_text(text), standard_registry(), answers, self.clock)
        self.path = folder / "ours.btlog"
        self.watch = Watch(self.tree, clock_us)
        self.watch.log(self.path)
        self.server = Server(self.watch.shown, Address(port=0))
        self.viewer = Viewer(self.server.address)

    def tick(self) -> str:
        self.clock.step()
        answer = self.tree.tick()
        self.watch.commit()
        return NAMES[answer]

    def close(self) -> None:
        self.viewer.socket.close()
        self.server.close()
        self.watch.close()


@pytest.fixture(params=TREES)
def both(request, tmp_path):
    text = f'<root BTCPP_format="4" main_tree_to_execute="Main">{TREES[request.param]}</root>'
    oracle, ours = Oracle(text, tmp_path), Ours(text, tmp_path)
    yield oracle, ours
    ours.close()
    oracle.close()


def asked(both, request, *more):
    """Return both replies without the tree's own number."""
    replies = [one.viewer.ask(request, *more) for one in both]
    return [[reply[0][:6], *reply[1:]] for reply in replies]


def records(data: bytes) -> list[bytes]:
    """Return transitions without their times."""
    return [data[at + 6 : at + 9] for at in range(0, len(data), 9)]


def plain(element: ET.Element) -> tuple:
    return element.tag, dict(element.attrib), (element.text or "").strip(), [plain(child) for child in element]


def test_trees_are_written_alike(both):
    theirs, ours = (ET.fromstring(reply[1]) for reply in asked(both, "T"))  # noqa: S314 - our own
    assert [plain(one) for one in ours.iter("BehaviorTree")] == [plain(one) for one in theirs.iter("BehaviorTree")]


def port(element: ET.Element) -> tuple:
    """Return direction, type and default; types that only C++ has a name for, and that of scripts, are any."""
    name, kind = element.get("name"), element.get("type")
    return element.tag, "any" if name == "code" or kind.startswith(("BT::Any", "std::shared_ptr")) else kind, element.get("default")


def models(xml: bytes) -> dict:
    model = ET.fromstring(xml).find("TreeNodesModel")  # noqa: S314 - our own
    return {one.get("ID"): (one.tag, {part.get("name"): port(part) for part in one}) for one in model}


def test_models_of_nodes_are_alike(both):
    theirs, ours = (models(reply[1]) for reply in asked(both, "T"))
    assert set(theirs) - set(ours) <= {"SubTree", *SCRIPT}
    common = set(theirs) & set(ours) - {"SubTree"}
    assert {name: ours[name] for name in common} == {name: theirs[name] for name in common}


def test_every_tick_looks_alike(both):
    boards = ";".join(subtree.path or subtree.tree_id for subtree in both[1].tree.subtrees)
    for reply in asked(both, "r", b"start"):
        assert reply[1].isdigit()
    for _ in range(TICKS):
        theirs, ours = (one.tick() for one in both)
        assert ours == theirs
        theirs, ours = asked(both, "S")
        assert ours == theirs
        theirs, ours = asked(both, "B", boards.encode())
        assert ours == theirs
        theirs, ours = asked(both, "t")
        assert ours[0] == theirs[0]
        assert records(ours[1]) == records(theirs[1])


def logged(path: Path) -> list[tuple[int, int]]:
    """Return the transitions in a log, none while the tree that it begins with is still being written: the oracle's file is buffered."""
    try:
        return [(one.uid, one.status) for one in read_log(path).transitions]
    except LogError:
        return []


def test_logs_are_alike(both):
    for _ in range(TICKS):
        for one in both:
            one.tick()
    oracle, ours = both  # the oracle's `flush` would race with its own thread: of 400 logs four had a tick twice, or rubbish
    wanted = logged(ours.path)
    assert wanted
    until(lambda: oracle.viewer.ask("S") and len(logged(oracle.path)) >= len(wanted), "its own thread has written")
    assert wanted == logged(oracle.path)
    theirs, mine = (one.path.read_bytes() for one in both)
    assert mine[:19] == theirs[:19]
    for data, one in ((theirs, oracle), (mine, ours)):
        (length,) = struct.unpack_from("<i", data, 19)
        assert data[23 : 23 + length] == one.viewer.ask("T")[1]


def test_what_is_refused_is_refused_alike(both):
    for request, *more in (("Z",), ("B",), ("r",), ("I",), ("R",), ("U",), ("D",), ("A",), ("X",), ("r", b"stop"), ("t",), ("B", b"")):
        theirs, ours = asked(both, request, *more)
        assert ours == theirs, request
    for hook in (b'{"uid":2,"position":0}', b'{"uid":999,"position":1}'):
        theirs, ours = asked(both, "R", hook)
        assert ours == theirs
    theirs, ours = (one.viewer.raw(b"123") for one in both)
    assert ours == theirs
