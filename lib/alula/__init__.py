"""Skills, missions and their proofs, without ROS.

A model says what a robot can do (`load_skillset`, `check_files`), hooks do it (`SkillHooks`, `LocalWorld`), a mission calls it
(`Mission`), and what came of that is a run (`open_run`)::

    import alula

    mission = alula.Mission.load("patrol", robot="robots/mine")
    assert mission.run("laser@20", seed=1).outcome is alula.Outcome.DEGRADED

These names are public, and so are those of `alula.trees` (nodes of one's own), `alula.parts` (what a robot adds to the commands),
``skillset_ros2`` and ``skillset_ros1``. Everything else is private, and may change without notice.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from alula.common.public import lazy_names

if TYPE_CHECKING:
    from alula.api.checking import check_files
    from alula.api.mission import Mission
    from alula.api.record import Record
    from alula.api.run import Run, open_run
    from alula.common.errors import AlulaError
    from alula.language.errors import Diagnostic, Severity
    from alula.language.load import load_skillset, parse_skillset
    from alula.missions.director import Outcome
    from alula.missions.mocked import MockedMission
    from alula.mock.behaviour import Behaviour
    from alula.mock.local_host import mock_world
    from alula.mock.reading import load_behaviour
    from alula.model.execution_state import ExecutionState
    from alula.model.model import Skillset
    from alula.runtime.core.execution import Execution
    from alula.runtime.hooks import SkillHooks
    from alula.runtime.local.world import LocalWorld

__all__ = [
    "AlulaError",
    "Behaviour",
    "Diagnostic",
    "Execution",
    "ExecutionState",
    "LocalWorld",
    "Mission",
    "MockedMission",
    "Outcome",
    "Record",
    "Run",
    "Severity",
    "SkillHooks",
    "Skillset",
    "check_files",
    "load_behaviour",
    "load_skillset",
    "mock_world",
    "open_run",
    "parse_skillset",
]

_DEFINED_IN = {
    "alula.api.checking": ("check_files",),
    "alula.api.mission": ("Mission",),
    "alula.api.record": ("Record",),
    "alula.api.run": ("Run", "open_run"),
    "alula.common.errors": ("AlulaError",),
    "alula.language.errors": ("Diagnostic", "Severity"),
    "alula.language.load": ("load_skillset", "parse_skillset"),
    "alula.missions.director": ("Outcome",),
    "alula.missions.mocked": ("MockedMission",),
    "alula.model.execution_state": ("ExecutionState",),
    "alula.model.model": ("Skillset",),
    "alula.runtime.core.execution": ("Execution",),
    "alula.runtime.hooks": ("SkillHooks",),
    "alula.runtime.local.world": ("LocalWorld",),
    "alula.mock.behaviour": ("Behaviour",),
    "alula.mock.local_host": ("mock_world",),
    "alula.mock.reading": ("load_behaviour",),
}

if not TYPE_CHECKING:  # so that a type checker knows these names and no others
    __getattr__, __dir__ = lazy_names(__name__, _DEFINED_IN, globals())
