"""What is wrong with a model that reads well, found without a search through its executions.

Names that lead nowhere, effects that no transition allows, periods, duplicates, names that ROS or generated code can't have.
"""

from alula.language.check.findings import MAX_FINDINGS, check

__all__ = ["MAX_FINDINGS", "check"]
