"""The later Robot Language of the paper's authors (files `*.rl`), and what it needs to say all that the paper's notation says."""

from alula.language.rl.notation import ROBOT_LANGUAGE, parse

__all__ = ["ROBOT_LANGUAGE", "parse"]
