"""The panel's screen: shows what the watcher has heard, a few times a second, and passes on what keys and buttons ask for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Protocol

from rich.text import Text
from textual.app import App, ComposeResult
from textual.binding import BindingType
from textual.containers import Horizontal, Vertical
from textual.widgets import Button, DataTable, Footer, Header, RichLog, Static

from alula.console.form import FormError, fields, values
from skill_panel.memory import Memory
from skill_panel.watcher import Watched
from skill_panel.widgets import FORM_KEYS, DataLines, ResourceLine, ResourceList, SkillForm, SkillsetBar, SkillTable

REFRESH_S = 0.1
NO_SKILLSET = """No skillset is running {where}.

Start one in another terminal:
  ./alula fly mapping            a flight in the simulator; this panel finds it: ./alula panel --run latest
  ./alula mock skillsets/uav     mocks, nothing flies

{others}This page goes away as soon as one is there."""


class Source(Protocol):
    """What the screen needs of a ``Watcher``."""

    @property
    def watched(self) -> list[Watched]:
        """The skillsets found so far, by name."""
        ...

    @property
    def problems(self) -> list[str]:
        """What keeps skillsets that are there from being shown."""
        ...

    @property
    def now_ns(self) -> int:
        """Mission clock, nanoseconds."""
        ...


class Panel(App[None]):
    """All running skillsets, one at a time on the screen."""

    TITLE = "Alula panel"
    CSS_PATH = "panel.tcss"
    ENABLE_COMMAND_PALETTE = False
    BINDINGS: ClassVar[list[BindingType]] = list(FORM_KEYS)

    def __init__(self, source: Source, *, where: str, others: Sequence[str] = (), memory: Memory | None = None) -> None:
        super().__init__()
        self.sub_title = where
        self._source = source
        self._where = where
        self._others = others
        self._memory = Memory(None) if memory is None else memory
        self._root = ""
        self._logged = 0
        self._shown: tuple[str, str] = ("", "")

    def compose(self) -> ComposeResult:
        """Yield the widgets of the screen: skillsets, skills with their form, resources, data, log."""
        yield Header()
        yield SkillsetBar(id="skillsets")
        yield Static(id="no-skillset")
        with Horizontal(id="middle"):
            with Vertical(id="left"):
                yield SkillTable(id="skills")
                yield SkillForm()
            with Vertical(id="right"):
                resources = ResourceList(id="resources")
                resources.border_title = "resources"
                yield resources
                data = DataLines(id="data")
                data.border_title = "data"
                yield data
        log = RichLog(id="log", max_lines=1000, wrap=True, min_width=0)
        log.border_title = "events"
        yield log
        yield Footer()

    async def on_mount(self) -> None:
        """Begin to show what is heard."""
        self.query_one("#log", RichLog).can_focus = False
        await self._refresh()
        self.set_interval(REFRESH_S, self._refresh)

    # --- what is shown -----------------------------------------------------------------------------------------------

    @property
    def current(self) -> Watched | None:
        """The skillset on the screen."""
        return next((one for one in self._source.watched if one.root == self._root), None)

    async def _refresh(self) -> None:
        if not self.query(SkillsetBar):  # the screen is being taken down
            return
        watched = self._source.watched
        self._refresh_bar([one.root for one in watched])
        found = bool(watched)
        for name in ("skillsets", "middle", "log"):
            self.query_one(f"#{name}").display = found
        self.query_one("#no-skillset").display = not found
        if not found:
            self.query_one("#no-skillset", Static).update(Text(self._no_skillset()))
        elif self.current is not None:
            await self._refresh_skillset(self.current)

    def _no_skillset(self) -> str:
        others = "".join(f"{line}\n" for line in (*self._source.problems, *self._others))
        return NO_SKILLSET.format(where=self._where, others=f"{others}\n" if others else "")

    def _refresh_bar(self, roots: Sequence[str]) -> None:
        if self._root not in roots and roots:
            self._choose(roots[0])
        self.query_one(SkillsetBar).show(roots, self._root)

    def _choose(self, root: str) -> None:
        self._root, self._logged, self._shown = root, 0, ("", "")
        self.query_one("#log", RichLog).clear()
        self.query_one("#skills", SkillTable).focus()

    async def _refresh_skillset(self, one: Watched) -> None:
        view = one.view
        if view is None:
            return
        rows = view.skill_rows()
        table = self.query_one("#skills", SkillTable)
        table.show(rows)
        table.border_title = one.root if view.alive else f"{one.root}: the managers have gone"
        table.set_class(not view.alive, "gone")
        self.query_one(ResourceList).show(view.resource_rows())
        self.query_one(DataLines).show(view.data_rows(self._source.now_ns))
        self._refresh_log(one)
        await self._refresh_form(one, table.selected)
        form = self.query_one(SkillForm)
        for row in rows:
            if row.name == form.skill:
                form.needs(row)

    async def _refresh_form(self, one: Watched, skill: str) -> None:
        if skill and self._shown != (one.root, skill) and one.view is not None:
            self._shown = (one.root, skill)
            remembered = self._memory.texts(one.client.skillset, skill)
            await self.query_one(SkillForm).take(skill, fields(one.view.model.skill(skill), one.client.input_types(skill), remembered))

    def _refresh_log(self, one: Watched) -> None:
        if one.view is None or one.view.logged == self._logged:
            return
        log, lines, count = self.query_one("#log", RichLog), list(one.view.log), one.view.logged
        for line in lines[-(count - self._logged) :]:
            log.write(Text(line), width=max(log.scrollable_content_region.width, 40))
        self._logged = count

    # --- what is wanted ----------------------------------------------------------------------------------------------

    def on_skillset_bar_wanted(self, event: SkillsetBar.Wanted) -> None:
        """Show the skillset that was chosen in the bar."""
        self._choose(event.root)

    def on_data_table_row_selected(self, event: DataTable.RowSelected) -> None:
        """Go to the inputs of the skill; start it where it has none."""
        event.stop()
        if self.query_one(SkillForm).texts:
            self.action_inputs()
        else:
            self.action_start()

    def on_skill_form_start(self, event: SkillForm.Start) -> None:
        """Start with what stands in the form."""
        self._start(event.skill, event.texts)

    def on_resource_line_wanted(self, event: ResourceLine.Wanted) -> None:
        """Ask the managers for the extern transition whose button was pressed."""
        if self.current is not None:
            self.current.transition(event.resource, event.to)

    def on_button_pressed(self, event: Button.Pressed) -> None:
        """Do what the button says."""
        actions = {"start": self.action_start, "interrupt": self.action_interrupt, "pause": self.action_pause, "why": self.action_why}
        action = actions.get(event.button.id or "")
        if action is not None:
            action()

    def action_start(self) -> None:
        """Start the skill of the form."""
        form = self.query_one(SkillForm)
        self._start(form.skill, form.texts)

    def action_interrupt(self) -> None:
        """Interrupt what runs of the skill of the form."""
        if self.current is not None and self._skill:
            self.current.interrupt(self._skill)

    def action_pause(self) -> None:
        """Pause or resume what runs of the skill of the form."""
        if self.current is not None and self._skill:
            self.current.set_paused(self._skill)

    def action_why(self) -> None:
        """Have the managers explain the skill of the form in the log."""
        if self.current is not None and self._skill:
            self.current.ask_why(self._skill)

    def action_skills(self) -> None:
        """Give the table of skills the keyboard."""
        self.query_one("#skills", SkillTable).focus()

    def action_inputs(self) -> None:
        """Go to the first input."""
        for one in self.query_one(SkillForm).query("Input"):
            one.focus()
            return

    def action_resources(self) -> None:
        """Go to the first extern transition that is possible."""
        for one in self.query("ResourceLine Button"):
            if one.display:
                one.focus()
                return

    def action_skillset(self, step: int) -> None:
        """Show the next or the previous skillset."""
        roots = [one.root for one in self._source.watched]
        if self._root in roots:
            self._choose(roots[(roots.index(self._root) + step) % len(roots)])

    @property
    def _skill(self) -> str:
        return self.query_one(SkillForm).skill

    def _start(self, skill: str, texts: dict[str, str]) -> None:
        one, form = self.current, self.query_one(SkillForm)
        if one is None or not skill:
            return
        try:
            one.start(skill, values(form.fields, texts))
        except (FormError, ValueError) as error:
            form.complain(str(error))
            return
        form.complain("")
        self._memory.keep(one.client.skillset, skill, texts)
        self.action_skills()
