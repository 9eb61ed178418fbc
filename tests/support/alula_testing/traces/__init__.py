"""One script of stimuli for a skillset's managers, played over any middleware, and what came of it in a form that can be compared."""

from alula_testing.traces.play import play
from alula_testing.traces.script import Behaviour, Script, Step
from alula_testing.traces.stage import Stage

__all__ = ["Behaviour", "Script", "Stage", "Step", "play"]
