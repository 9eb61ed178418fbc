"""Errors of the simulator, under one root."""


class SimulatorError(Exception):
    """The simulator can't do what was requested; the message has the value, the place and the remedy."""


class ConfigError(SimulatorError):
    """A configuration file or parameter is wrong."""
