"""What the clients of a skillset have in common over every middleware: they know its model, and refuse what can't be asked for."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable

from skill_model.model import Data, Skillset
from skill_runtime.handle import SkillHandle
from skill_runtime.waiting import Host


class ClientBase(ABC):
    """A client of one skillset.

    Args:
        skillset: its name.
        host: how a thread waits for what this client brings.
    """

    def __init__(self, skillset: str, host: Host) -> None:
        self.skillset = skillset
        self._host = host

    @property
    @abstractmethod
    def ready(self) -> bool:
        """Tell whether the managers are alive, known and can be called."""

    @property
    @abstractmethod
    def _described(self) -> Skillset | None:
        """Return the model as the managers have described it; None before they have."""

    @property
    def model(self) -> Skillset:
        """Return the model that the managers execute; raise RuntimeError before ``wait_ready``."""
        if self._described is None:
            raise RuntimeError(f"the managers of {self.skillset} have not described themselves yet; call wait_ready first")
        return self._described

    def _check_skill(self, skill: str) -> None:
        known = [known.name for known in self.model.skills]
        if skill not in known:
            raise ValueError(f"skillset {self.skillset} has no skill {skill!r}; it has {', '.join(known)}")

    def _find_data(self, name: str) -> Data:
        known = {data.name: data for data in self.model.data}
        if name not in known:
            raise ValueError(f"skillset {self.skillset} has no data {name!r}; it has {', '.join(known) or 'none'}")
        return known[name]

    def _place(self, skill: str) -> str:
        """Return what errors call the inputs of a skill."""
        return f"inputs of {self.skillset}.{skill}"

    def _check_complete(self, skill: str, needed: Iterable[str], given: Collection[str]) -> None:
        missing = [name for name in needed if name not in given]
        if missing:
            raise ValueError(f"{self._place(skill)}: {', '.join(missing)} missing")

    def _not_there(self) -> str:
        return f"the managers of {self.skillset} are not there"

    def _stillborn(self, skill: str) -> SkillHandle:
        """Return the handle of an execution that can't be asked for now."""
        handle = SkillHandle(skill, "", host=self._host)
        handle.fail(self._not_there())
        return handle
