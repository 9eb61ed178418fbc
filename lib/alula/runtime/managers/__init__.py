"""The managers of a skillset (paper, section 4.2 and Figure 2), over any middleware."""

from alula.runtime.managers.data import DataBindings, generated_bindings
from alula.runtime.managers.managers import HOOKS_RETURN_S, MakeInputs, Managers

__all__ = ["HOOKS_RETURN_S", "DataBindings", "MakeInputs", "Managers", "generated_bindings"]
