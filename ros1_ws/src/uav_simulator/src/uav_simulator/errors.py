"""Errors of the simulator, under one root."""


class SimulatorError(Exception):
    """Something that the simulator was told can't be done; the message names the value, the place and the remedy."""


class ConfigError(SimulatorError):
    """A configuration file or parameter is wrong."""
