"""Leaves that need no robot."""

from __future__ import annotations

from alula.trees.ends import ENDS, FAILS, SUCCEEDS
from alula.trees.node import NANOSECONDS_PER_MS, Action, Condition, Node, NodeConfig, Script, SyncAction
from alula.trees.ports import input_port, script_port
from alula.trees.status import FAILURE, RUNNING, SUCCESS, Answer
from alula.trees.values import UINT


class AlwaysSuccess(SyncAction):
    """Succeeds."""

    ends = SUCCEEDS

    def update(self) -> Answer:
        """Succeed."""
        return SUCCESS


class AlwaysFailure(SyncAction):
    """Fails."""

    ends = FAILS

    def update(self) -> Answer:
        """Fail."""
        return FAILURE


class _Code:
    """The script of a node, read again when its text is another one."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._text = ""
        self._script: Script | None = None
        if not node.config.ports.get("code", "").lstrip().startswith("{") and not self.is_empty:
            self.script()  # what is wrong in it is told when the tree is made

    @property
    def is_empty(self) -> bool:
        """Whether the file gives it as an empty text, and that does nothing, as editors write a Script."""
        return self._node.config.ports.get("code") == "" and self._node.config.type.ports["code"].may_be_empty

    def script(self) -> Script:
        """Return it."""
        text = str(self._node.get("code"))
        if self._script is None or text != self._text:
            self._script, self._text = self._node.config.compile(text, "code"), text
        return self._script


class ScriptNode(SyncAction):
    """Runs a script, and succeeds."""

    ports = (script_port("code", "the script", may_be_empty=True),)
    runs_script = "code"

    ends = SUCCEEDS

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._code = _Code(self)

    def update(self) -> Answer:
        """Run it."""
        if not self._code.is_empty:
            self._code.script().run()
        return SUCCESS


class ScriptCondition(Condition):
    """Succeeds when a script says yes."""

    ports = (script_port("code", "the script"),)
    answers_by = "code"

    ends = ENDS

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._code = _Code(self)

    def update(self) -> Answer:
        """Ask."""
        script = self._code.script()
        holds = script.holds()
        self.feedback_message = script.unknown
        return SUCCESS if holds else FAILURE


class Sleep(Action):
    """Runs for some time, then succeeds."""

    ports = (input_port("msec", UINT, doc="for how long", unit="ms"),)

    remembers_running = ("_until_ns",)

    ends = SUCCEEDS

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._until_ns = 0

    def on_start(self) -> Answer:
        """Begin to wait."""
        duration_ns = self.number("msec") * NANOSECONDS_PER_MS
        self._until_ns = self.now_ns + duration_ns
        return RUNNING if duration_ns else SUCCESS

    def on_running(self) -> Answer:
        """Wait."""
        return RUNNING if self.now_ns < self._until_ns else SUCCESS
