"""The parts of the panel's screen; they show rows of ``view`` and post messages when something is wanted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from rich.style import Style
from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.message import Message
from textual.widgets import Button, DataTable, Input, Label, Static

from alula.console.form import Field
from alula.console.view import DataRow, ResourceRow, SkillRow

BAR_WIDTH = 10
STATUS_STYLES = {"ready": "green", "not ready": "yellow", "RUNNING": "bold cyan", "PAUSED": "bold magenta", "INTERRUPTING": "bold red"}


def bar(progress: float | None) -> str:
    """Return a progress from 0 to 1 as a bar and a percentage; empty for None."""
    if progress is None:
        return ""
    done = round(min(1.0, max(0.0, progress)) * BAR_WIDTH)
    return f"{'█' * done}{'░' * (BAR_WIDTH - done)} {progress:4.0%}"


class SkillsetBar(Static):
    """The skillsets in one line, the one on the screen marked; a click chooses another."""

    class Wanted(Message):
        """The user chose another skillset."""

        def __init__(self, root: str) -> None:
            super().__init__()
            self.root = root

    def show(self, roots: Sequence[str], current: str) -> None:
        """Show the names of the skillsets, the current one reversed."""
        text = Text()
        for root in roots:
            text.append(f" {root} ", Style(reverse=root == current, bold=root == current, meta={"@click": f"choose({root!r})"}))
            text.append(" ")
        self.update(text)

    def action_choose(self, root: str) -> None:
        """Tell the panel that this skillset was clicked."""
        self.post_message(self.Wanted(root))


class SkillTable(DataTable[Text]):
    """The skills, one a line; the line under the cursor is the one that keys speak of."""

    COLUMNS: ClassVar[Sequence[tuple[str, int]]] = (("skill", 18), ("state", 14), ("progress", 15), ("last end", 20))

    def on_mount(self) -> None:
        """Make the columns, with a cursor that selects whole rows."""
        self.cursor_type = "row"
        for name, width in self.COLUMNS:
            self.add_column(name, key=name, width=width)

    def show(self, rows: Sequence[SkillRow]) -> None:
        """Show the rows; lines stay where they are while the skills are the same."""
        if [str(key.value) for key in self.rows] != [row.name for row in rows]:
            self.clear()
            for row in rows:
                self.add_row(*(Text("") for _ in self.COLUMNS), key=row.name)
        for row in rows:
            progress = row.running[0].progress if row.running else None
            self._put(row.name, "skill", Text(row.name))
            self._put(row.name, "state", Text(row.status, STATUS_STYLES.get(row.status, "")))
            self._put(row.name, "progress", Text(bar(progress)))
            self._put(row.name, "last end", Text(row.last))

    def _put(self, row: str, column: str, text: Text) -> None:
        if self.get_cell(row, column) != text:
            self.update_cell(row, column, text)

    @property
    def selected(self) -> str:
        """The skill under the cursor; empty when there is none."""
        names = [str(key.value) for key in self.rows]
        return names[self.cursor_row] if 0 <= self.cursor_row < len(names) else ""


class DataLines(Static):
    """The data: name, value, age; stale ones dimmed."""

    def show(self, rows: Sequence[DataRow]) -> None:
        """Show each data with its value, age in seconds, and whether it is stale."""
        text = Text()
        for row in rows:
            age = "" if row.age_s is None else f"  {row.age_s:.1f} s ago"
            stale = "  stale" if row.stale and row.age_s is not None else ""
            text.append(f"{row.name}{age}", "bold")
            text.append(f"{stale}\n", "bold red")
            text.append(f"  {row.value}\n", "dim" if row.stale else "")
        self.update(text if rows else Text("none in this model", "dim"))


class ResourceLine(Horizontal):
    """One resource: its name, its state, and a button for each extern transition that is possible now."""

    class Wanted(Message):
        """An extern transition was asked for."""

        def __init__(self, resource: str, to: str) -> None:
            super().__init__()
            self.resource = resource
            self.to = to

    def __init__(self, row: ResourceRow) -> None:
        super().__init__(classes="resource")
        self.row = row
        self._state = Label(row.state, classes="resource-state")
        self._buttons = [Button(f"→ {to}", name=to, compact=True, classes="transition") for to in row.every_target]

    def compose(self) -> ComposeResult:
        """Yield name, state and a button for each extern transition."""
        yield Label(self.row.name, classes="resource-name")
        yield self._state
        yield from self._buttons

    def on_mount(self) -> None:
        """Show what is possible now."""
        self.show(self.row)

    def show(self, row: ResourceRow) -> None:
        """Show the state and its buttons at once; where one that goes had the focus, the line's first one takes it.

        The buttons of all states stay mounted: rebuilding them takes several turns of the event loop, and a focus that is set
        after those would take the keys from where the user has gone meanwhile.
        """
        focused = self.screen.focused
        self.row = row
        self._state.update(row.state)
        self._state.tooltip = row.reason or None
        for button in self._buttons:
            button.display = button.name in row.targets
        shown = [button for button in self._buttons if button.display]
        if isinstance(focused, Button) and focused in self._buttons and not focused.display:
            self.screen.set_focus(shown[0] if shown else None)

    def on_button_pressed(self, event: Button.Pressed) -> None:
        """Ask for the transition of the button."""
        event.stop()
        self.post_message(self.Wanted(self.row.name, event.button.name or ""))


class ResourceList(VerticalScroll):
    """A line for each resource of the skillset."""

    can_focus = False

    def show(self, rows: Sequence[ResourceRow]) -> None:
        """Show the rows; lines stay while the resources are the same."""
        lines = list(self.query(ResourceLine))
        if [(line.row.name, line.row.every_target) for line in lines] != [(row.name, row.every_target) for row in rows]:
            self.remove_children()
            self.mount_all(ResourceLine(row) for row in rows)
            return
        for line, row in zip(lines, rows, strict=True):
            if line.row != row:
                line.show(row)


class SkillForm(VerticalScroll):
    """The skill under the cursor: what it needs, its inputs as fields, and its buttons."""

    can_focus = False

    class Start(Message):
        """A start was asked for, with these texts by input."""

        def __init__(self, skill: str, texts: dict[str, str]) -> None:
            super().__init__()
            self.skill = skill
            self.texts = texts

    def __init__(self) -> None:
        super().__init__(id="form")
        self.skill = ""
        self._fields: Sequence[Field] = ()

    def compose(self) -> ComposeResult:
        """Yield the parts of the form: unmet preconditions, inputs, complaint, buttons."""
        yield Static(id="needs")
        yield Vertical(id="fields")
        yield Static(id="complaint")
        with Horizontal(id="buttons"):
            yield Button("Start (F5)", id="start", variant="success", compact=True)
            yield Button("Interrupt (F6)", id="interrupt", variant="error", compact=True)
            yield Button("Pause/resume (F7)", id="pause", compact=True)
            yield Button("Why? (F8)", id="why", compact=True)

    async def take(self, skill: str, fields: Sequence[Field]) -> None:
        """Show another skill, with a text field for each of its inputs."""
        self.skill, self._fields = skill, fields
        self.complain("")
        self.border_title = skill
        place = self.query_one("#fields", Vertical)
        await place.remove_children()
        for field in fields:
            await place.mount(Horizontal(Label(field.label, classes="field-label"), Input(field.text, name=field.name, compact=True)))

    def needs(self, row: SkillRow) -> None:
        """Show whether the skill could start now, and what is missing."""
        text = Text("could start now", "green")
        if row.running:
            text = Text(", ".join(f"{one.state} {one.id[:6]}" for one in row.running), "bold cyan")
        elif row.unmet:
            text = Text("could not start now:\n", "yellow") + Text("\n".join(f"  {reason}" for reason in row.unmet))
        self.query_one("#needs", Static).update(text)

    def complain(self, text: str) -> None:
        """Say what is wrong with the inputs; empty for nothing."""
        self.query_one("#complaint", Static).update(Text(text, "bold red"))

    @property
    def fields(self) -> Sequence[Field]:
        """The fields as they were made."""
        return self._fields

    @property
    def texts(self) -> dict[str, str]:
        """What stands in the fields."""
        return {str(one.name): one.value for one in self.query(Input)}

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """Go to the next field, or start behind the last one."""
        event.stop()
        inputs = list(self.query(Input))
        after = inputs[inputs.index(event.input) + 1 :]
        if after:
            after[0].focus()
        else:
            self.post_message(self.Start(self.skill, self.texts))


FORM_KEYS = [
    Binding("f5", "start", "start"),
    Binding("f6", "interrupt", "interrupt"),
    Binding("f7", "pause", "pause/resume"),
    Binding("f8", "why", "why"),
    Binding("s", "skills", "skills", show=False),
    Binding("i", "inputs", "inputs"),
    Binding("r", "resources", "resources"),
    Binding("escape", "skills", "skills"),
    Binding("left_square_bracket", "skillset(-1)", "previous skillset", key_display="["),
    Binding("right_square_bracket", "skillset(1)", "next skillset", key_display="]"),
    Binding("q", "quit", "quit"),
]
"""Keys of the panel; letters act where no text field has the focus."""
