"""Hooks in processes of their own, one a skill, which speak over a local pipe to the process that has the engine.

The engine is whole and in one process, so each step is atomic as ever; ``RemoteHooks`` is a caller of hooks among others. The end of
the pipe is the notice of death: a skill's process that ends fails its executions with their interrupt effect, and the end of the
engine's process has the functions stopped. Each finds the other again when it is restarted.

To a skill's process go ``("call", number, hook, snapshot)``, ``("event", snapshot)`` and ``("reply", number, value)``; to the engine's
``("hello", skill, written)``, ``("answer", number, HookOutcome)`` and ``("ask", number, method, execution, arguments)``. What hooks hand
over and get is sealed: where it can't be read at the other end, its execution fails. Anything else that can't be read ends the pipe, and
with it all executions of the skill; its process makes another one. All are pickled, which only
processes of the same user may send: the pipe is a socket in a folder that no other user may enter, and before anything is unpickled,
each end shows the other that it has the key that lies there.
"""

from alula.runtime.hook_processes.caller import RemoteHooks
from alula.runtime.hook_processes.pipe import pipe_address
from alula.runtime.hook_processes.server import HookServer

__all__ = ["HookServer", "RemoteHooks", "pipe_address"]
