"""What all nodes are: one tick of a node with its pre- and postconditions, its halt, its ports.

A node is a py_trees Behaviour, for what looks at trees (names, children, status, ``iterate``); it is ticked here and not by py_trees, which
has neither answers that are no state (SKIPPED) nor BehaviorTree.CPP's halts: a parent halts the child that runs, and resets all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import ClassVar, Protocol, TypeAlias, TypeGuard, TypeVar

from py_trees.behaviour import Behaviour

from alula.common.public import public
from alula.trees.attributes import is_port
from alula.trees.blackboard import Blackboard, Clock, Entry
from alula.trees.document import Attribute, Element
from alula.trees.ends import ANY_END, Ends, Given
from alula.trees.errors import TickError
from alula.trees.node_type import CHILDREN, Category, NodeClass, NodeType
from alula.trees.ports import Port
from alula.trees.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, Answer, Status
from alula.trees.ticking import ANY_TICKING, Order, Ticking, never_ticked
from alula.trees.values import StandIn

NANOSECONDS_PER_MS = 1_000_000
Watcher = Callable[["Node", Status, Status], None]
"""Told of a node, what it was, and what it is now: at each change, in their order."""


@public("alula.trees")
class Script(Protocol):
    """A compiled script, bound to the blackboard of its node; its methods raise TickError."""

    unknown: str
    """Why its last answer as a condition was false, where that was because a value is not known."""

    def run(self) -> object:
        """Run it, and return its value."""
        ...

    def holds(self) -> bool:
        """Run it, and return whether its value is true."""
        ...


@dataclass
class Shared:
    """What all nodes of one tree share."""

    clock: Clock
    watchers: list[Watcher] = field(default_factory=list)
    woken: bool = False
    """A node that only gave the flow back wants the next tick at once."""


@dataclass(frozen=True, eq=False)
class NodeConfig:
    """The configuration of a node where it stands in a tree: the node that ticks is made of it; check and search read it.

    ``ports`` are those that the file gives or that have a default, as text; ``children`` of a subtree's use the top of that tree.
    """

    type: NodeType
    name: str
    uid: int
    path: str
    element: Element
    ports: Mapping[str, str]
    blackboard: Blackboard
    shared: Shared
    compile: Callable[[str, str], Script]
    """Makes a script of text over this node's blackboard, for the attribute that it stands in; raises FileError."""
    enums: Mapping[str, float] = field(default_factory=dict)
    parent: NodeConfig | None = None
    children: list[NodeConfig] = field(default_factory=list)

    @property
    def is_subtree(self) -> bool:
        """Return whether it is the use of another tree."""
        return self.type.category is Category.SUBTREE

    @cached_property
    def is_whole(self) -> bool:
        """Whether it has as many children as its type takes: not the use of a tree that there is not."""
        least, most = self.type.children
        return least <= len(self.children) <= (len(self.children) if most is None else most)

    @property
    def described(self) -> NodeClass | None:
        """The class that describes how it ticks its children and ends; None without one, or where its number of children is wrong."""
        return self.type.described if self.is_whole else None

    @property
    def may_run(self) -> bool | None:
        """Whether it may take several ticks, its children aside; None: not known."""
        return self.type.may_run if self.is_whole else None

    @property
    def ticking(self) -> Ticking:
        """How it ticks its children."""
        return self.type.ticking if self.is_whole else ANY_TICKING

    def port_attributes(self) -> Iterator[Attribute]:
        """Yield the attributes of its element that are ports."""
        yield from (one for name, one in self.element.attributes.items() if is_port(name))

    def walk(self) -> Iterator[NodeConfig]:
        """Yield the node and all below it, in the order of the file."""
        left = [self]
        while left:
            one = left.pop()
            yield one
            left.extend(reversed(one.children))

    def above(self) -> Iterator[tuple[NodeConfig, NodeConfig]]:
        """Yield each node above with its child on the way, from here up."""
        one = self
        while one.parent is not None:
            yield one.parent, one
            one = one.parent


@dataclass(frozen=True)
class Before:
    """The preconditions of a node, None where it has none; asked when it is idle, ``while_true`` while it runs, too."""

    failure_if: Script | None = None
    success_if: Script | None = None
    skip_if: Script | None = None
    while_true: Script | None = None


@dataclass(frozen=True)
class After:
    """What is run when a node has ended."""

    on_halted: Script | None = None
    on_failure: Script | None = None
    on_success: Script | None = None
    always: Script | None = None


@dataclass(frozen=True)
class Count:
    """An attribute of a node that counts: ``what`` is what messages call it, ``down`` counts to 0."""

    attribute: str
    what: str
    down: bool = False


def pointer(text: str, name: str) -> str | None:
    """Return the entry that the text of a port names (``{entry}``, ``{=}`` for the port's own name), None for a plain value."""
    stripped = text.strip(" ")
    if stripped in {"{=}", "="}:
        return name
    return stripped[1:-1] if len(stripped) >= 3 and stripped[0] == "{" and stripped[-1] == "}" else None


_TELLS = frozenset({"ticking", "ends", "may_end", "never_ticked"})
_ANSWERS = ("execute", "update", "on_start", "on_running")
_HALTS = ("halt", "halt_node", "reset_children", "reset_child", "become", "give_way")


@public("alula.trees")
class Node(Behaviour):  # type: ignore[misc]  # py_trees is seen untyped
    """Base of all nodes; derive from `SyncAction`, `Action`, `Condition`, `Decorator` or `Control`, and declare `ports`."""

    category: ClassVar[Category]
    registered_name: ClassVar[str] = ""
    """The name of the type in files, which `register` sets; empty: the name of the class."""
    ports: ClassVar[tuple[Port, ...]] = ()
    child_count: ClassVar[tuple[int, int | None] | None] = None
    """The least and the largest number of children; None: those of its category."""
    remembers: ClassVar[tuple[str, ...]] = ()
    """The attributes that keep values from tick to tick, besides the status: all that restores a node to another moment."""
    remembers_running: ClassVar[tuple[str, ...]] = ()
    """Those of `remembers` that are set anew when the node begins: they have no effect while it does not run."""
    counts: ClassVar[tuple[Count, ...]] = ()
    """Those of `remembers` that count; a search of all runs distinguishes a few of their numbers."""
    watches: ClassVar[Mapping[str, str]] = {}
    """Those that hold how often an entry was written: by attribute, the port that names the entry."""
    ticking: ClassVar[Ticking] = ANY_TICKING
    """How it ticks its children; what is not declared may be anything."""
    ends: ClassVar[Ends] = ANY_END
    """The ends that it may have, where they depend neither on ports nor on children."""
    may_run: ClassVar[bool | None] = None
    """Whether it may answer RUNNING by itself, apart from its children; None: not known."""
    answers_by: ClassVar[str] = ""
    """The port with the condition that decides the answer of a leaf; empty where something else decides, too."""
    runs_script: ClassVar[str] = ""
    """The port with the script, where a leaf does nothing but run it."""
    takes_away: ClassVar[str] = ""
    """The port that names an entry which it deletes from the blackboard."""
    status: Status
    children: list[Node]

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config.name)
        self.config = config
        self.before: Before | None = None
        self.after: After | None = None
        self.uid = config.uid
        self._shared = config.shared
        self._constants: dict[str, object] = {}

    def setup(self) -> None:
        """Prepare what ticks need, such as the scripts of ports; called once, when the tree is built. Errors should name the `place`."""

    # --- before anything is ticked -------------------------------------------------------------------------------------

    @classmethod
    def may_end(cls, given: Given, children: Sequence[Ends]) -> Ends:  # noqa: ARG003
        """Return all ends that it can have, given its ports and the ends of its children."""
        ticking = cls.known_ticking()
        return ticking.ends(children[0]) if ticking.order is Order.SINGLE else cls.ends

    @classmethod
    def never_ticked(cls, given: Given, children: Sequence[Ends]) -> Iterator[tuple[int, int]]:  # noqa: ARG003
        """Yield indices of children that are never ticked, each with that of the child whose ends prevent it; of a row the first."""
        yield from never_ticked(cls.ticking, children)

    @classmethod
    def is_described(cls) -> bool:
        """Return whether the class describes its ends: False for a subclass that overrides how it answers and describes nothing.

        `ticking`, `ends`, `may_end`, `never_ticked` belong to what answers: `execute`, `update`, `on_start`, `on_running`.
        """
        return cls._does_as(_TELLS, _ANSWERS)

    @classmethod
    def known_ticking(cls) -> Ticking:
        """Return how it ticks its children; anything, for a subclass that overrides how it answers or halts and describes nothing."""
        return cls.ticking if cls._does_as(frozenset({"ticking"}), (*_ANSWERS, *_HALTS)) else ANY_TICKING

    @classmethod
    def as_type(cls, name: str = "") -> TickableType:
        """Return its node type under a name, by default the one it was registered by."""
        doc = (cls.__doc__ or "").strip().partition("\n")[0]
        ports = {port.name: port for port in cls.ports}
        children = cls.child_count or CHILDREN[cls.category]
        return TickableType(name or name_in_files(cls), cls.category, ports, doc, children, make=cls)

    @classmethod
    def _does_as(cls, tells: frozenset[str], names: Sequence[str]) -> bool:
        """Return whether methods are those of the class that tells something."""
        teller = next(one for one in cls.__mro__ if not tells.isdisjoint(vars(one)))
        both = ((getattr(cls, name, None), getattr(teller, name, None)) for name in names)
        return teller is Node or all(mine is told or told in {None, Node.update} for mine, told in both)

    # --- ticks ---------------------------------------------------------------------------------------------------------

    def execute(self) -> Answer:
        """Tick the node once: preconditions, then `update`, then postconditions."""
        before = self.before
        answer = None if before is None else self._guarded(before)
        if answer is None:
            answer = self.update()
        if answer is SKIPPED:
            return answer
        if self.after is not None and answer is not RUNNING:
            self._ended(self.after, answer)
        self.become(answer)
        return answer

    def update(self) -> Answer:
        """Do one tick of this type of node, and return the answer; not called when a precondition has decided."""
        raise NotImplementedError

    def halt(self) -> None:
        """Stop what the node does and become idle; override it to reset what is kept from tick to tick."""
        raise NotImplementedError

    def halt_node(self) -> None:
        """Halt the node, then run its script ``_onHalted``."""
        self.halt()
        if self.after is not None and self.after.on_halted is not None:
            self.after.on_halted.run()

    def become(self, status: Answer) -> None:
        """Set the status, and call the watchers."""
        previous = self.status
        if status is not previous and isinstance(status, Status):
            self.status = status
            for watcher in self._shared.watchers:
                watcher(self, previous, status)

    def give_way(self) -> Answer:
        """Return RUNNING and request the next tick at once, so that a long chain of quick nodes can be halted in between."""
        self._shared.woken = True
        return RUNNING

    def _guarded(self, before: Before) -> Answer | None:
        if self.status is RUNNING:
            if before.while_true is not None and not before.while_true.holds():
                self.halt_node()
                return SKIPPED
            return None
        if self.status is not IDLE:
            return None
        if before.failure_if is not None and before.failure_if.holds():
            return FAILURE
        if before.success_if is not None and before.success_if.holds():
            return SUCCESS
        if before.skip_if is not None and before.skip_if.holds():
            return SKIPPED
        return SKIPPED if before.while_true is not None and not before.while_true.holds() else None

    def _ended(self, after: After, answer: Answer) -> None:
        script = after.on_success if answer is SUCCESS else after.on_failure if answer is FAILURE else None
        if script is not None:
            script.run()
        if after.always is not None:
            after.always.run()

    @property
    def watchers(self) -> list[Watcher]:
        """The callbacks that receive each change of a status in the tree."""
        return self._shared.watchers

    # --- py_trees ------------------------------------------------------------------------------------------------------

    def tick(self) -> Iterator[Behaviour]:
        """Tick the node once, with the signature of py_trees."""
        self.execute()
        yield self

    def stop(self, new_status: Status = IDLE) -> None:
        """Halt the node if it runs, and set ``new_status``, with the signature of py_trees."""
        if self.status is RUNNING:
            self.halt_node()
        self.become(new_status)

    # --- ports ---------------------------------------------------------------------------------------------------------

    @property
    def blackboard(self) -> Blackboard:
        """The blackboard of the tree or subtree that contains the node."""
        return self.config.blackboard

    @property
    def now_ns(self) -> int:
        """Mission clock, nanoseconds."""
        return self._shared.clock()

    def given(self, port: str) -> bool:
        """Return whether a port has a text, from the file or by default."""
        return port in self.config.ports

    def get(self, port: str) -> object:
        """Return the value of an input, of its port's type; raises TickError without one, or for one of another type."""
        constants = self._constants
        if port in constants:
            return constants[port]
        text = self.config.ports.get(port)
        if text is None:
            raise TickError(f"{self.place()}: the port '{port}' is not given")
        key = pointer(text, port)
        type_ = self.config.type.ports[port].type
        try:
            if key is None:
                constants[port] = type_.parse(text)
                return constants[port]
            value = self.blackboard.get(key)
            if value is None:
                raise TickError(f"{self.place()}: the port '{port}' reads '{key}', which nothing has written")
            return type_.read(value)
        except ValueError as error:
            raise TickError(f"{self.place()}: the port '{port}': {error}") from None

    def script(self, port: str, default: str | None = None) -> Script:
        """Compile the script of a port; call it in `setup`. Raises FileError where the script is wrong, TickError without one."""
        text = self.config.ports.get(port, default)
        if text is None:
            raise TickError(f"{self.place()}: the port '{port}' is not given")
        if port not in self.config.type.scripts:
            raise TickError(f"{self.place()}: the port '{port}' holds a script, and does not say so: declare it with script_port('{port}')")
        return self.config.compile(text, port)

    def number(self, port: str) -> int:
        """Return the value of an input that is a whole number."""
        value = self.get(port)
        if isinstance(value, int) or (isinstance(value, float) and isinstance(value, StandIn)):
            return value  # type: ignore[return-value]  # of a whole number nobody knows
        raise TickError(f"{self.place()}: the port '{port}' is no whole number")

    def real(self, port: str) -> float:
        """Return the value of an input that is a number."""
        value = self.get(port)
        if isinstance(value, int | float):
            return float(value)
        raise TickError(f"{self.place()}: the port '{port}' is no number")

    def put(self, port: str, value: object) -> None:
        """Write an output; nothing is written where the file gives no entry for it, or an empty text."""
        text = self.config.ports.get(port)
        if not text:
            return
        key = pointer(text, port)
        if key is None:
            raise TickError(f"{self.place()}: the port '{port}' is written, so it has to name an entry, as {{{text}}}")
        self.blackboard.set(key, value, self.config.type.ports[port].type)

    def entry(self, port: str) -> Entry | None:
        """Return the entry that a port names, None when there is none."""
        text = self.config.ports.get(port, "")
        return self.blackboard.entry(pointer(text, port) or text)

    def place(self) -> str:
        """Return the node's place in the file and its name, for messages."""
        return f"{self.config.element.place} ({self.name})"


Maker: TypeAlias = "Callable[[NodeConfig], Node]"
"""Makes a node of its config, as its class does."""


@dataclass(frozen=True, kw_only=True)
class TickableType(NodeType):
    """A type of node that can be ticked: ``make`` makes a node of its config."""

    is_tickable = True
    make: Maker

    @property
    def teller(self) -> NodeClass | None:
        """The class that describes its nodes: the one that makes them, unless another one does."""
        return self.tells or (self.make if _is_class(self.make) else None)

    def instantiate(self, config: NodeConfig) -> Node:
        """Make a node, ready to be ticked; raises FileError."""
        node = self.make(config)
        node.setup()
        return node


def tickable(known: NodeType, make: Maker) -> TickableType:
    """Return a type with what makes its nodes, else as it is."""
    described = {one.name: getattr(known, one.name) for one in fields(NodeType)}
    return TickableType(**described, make=make)


def _is_class(make: object) -> TypeGuard[type[Node]]:
    return isinstance(make, type)


def name_in_files(node: type[Node]) -> str:
    """Return what files call a class of nodes."""
    own = vars(node).get("registered_name", "")  # that of a base is the base's
    return str(own) or node.__name__


NodeT = TypeVar("NodeT", bound=Node)


@public("alula.trees")
def register(name: str) -> Callable[[type[NodeT]], type[NodeT]]:
    """Register a class of nodes under the name that files use, such as ``rover.NextDoor``; without it that is the class's name."""

    def named(node: type[NodeT]) -> type[NodeT]:
        node.registered_name = name
        return node

    return named


@public("alula.trees")
class Leaf(Node):
    """A node without children that ends in each tick."""

    category = Category.ACTION

    def halt(self) -> None:
        """Become idle."""
        self.become(IDLE)


@public("alula.trees")
class SyncAction(Leaf):
    """A leaf that acts, and is done in one tick: derive from it, and write `update`."""

    may_run = False

    def execute(self) -> Answer:
        """Tick it; raises TickError when it answers RUNNING."""
        answer = super().execute()
        if answer is RUNNING:
            raise TickError(f"{self.place()}: an action that ends in each tick answers RUNNING")
        return answer


@public("alula.trees")
class Condition(Leaf):
    """A leaf that answers a question, and changes nothing."""

    category = Category.CONDITION
    may_run = False


@public("alula.trees")
class Action(Leaf):
    """A leaf that may take several ticks: derive from it, and write `on_start`, `on_running` and `on_halted`."""

    may_run = True

    def update(self) -> Answer:
        """Call `on_start` when idle, `on_running` while RUNNING; after the end, repeat the answer until the parent resets the node."""
        if self.status is RUNNING:
            return self.on_running()
        return self.on_start() if self.status is IDLE else self.status

    def halt(self) -> None:
        """Call `on_halted` if it runs, and become idle, whatever that raises."""
        try:
            if self.status is RUNNING:
                self.on_halted()
        finally:
            self.become(IDLE)

    def on_start(self) -> Answer:
        """Begin, and return the status; called in the first tick."""
        raise NotImplementedError

    def on_running(self) -> Answer:
        """Go on, and return the status; called in each further tick."""
        raise NotImplementedError

    def on_halted(self) -> None:
        """Interrupt what runs, without waiting for its end; called when the tree leaves the node."""


@public("alula.trees")
class Control(Node):
    """A node with several children, which it ticks in an order of its own."""

    category = Category.CONTROL

    def halt(self) -> None:
        """Halt the children that run."""
        self.reset_children()
        self.become(IDLE)

    def reset_children(self, first: int = 0) -> None:
        """Halt the running children from index ``first`` on, and reset all of these to idle."""
        for child in self.children[first:] if first else self.children:
            if child.status is RUNNING:
                child.halt_node()
            child.become(IDLE)

    def reset_child(self, index: int) -> None:
        """Halt a child if it runs, and reset it to idle."""
        child = self.children[index]
        if child.status is RUNNING:
            child.halt_node()
        child.become(IDLE)


@public("alula.trees")
class Decorator(Control):
    """A node with one child, whose answer it changes, repeats or delays."""

    category = Category.DECORATOR

    def execute(self) -> Answer:
        """Tick the node; reset the child to idle when it has ended."""
        answer = super().execute()
        child = self.child
        if child.status is SUCCESS or child.status is FAILURE:
            child.become(IDLE)
        return answer

    @property
    def child(self) -> Node:
        """Its child."""
        return self.children[0]
