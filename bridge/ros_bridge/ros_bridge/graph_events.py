"""Wait for changes of the ROS 2 graph: rclpy does not hand out the node's graph guard condition, so this asks rcl itself, by ctypes.

The calls and structures are those of rcl's public headers ``rcl/graph.h``, ``rcl/wait.h`` and ``rcutils/allocator.h`` (Jazzy).
"""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING

from ros_bridge.errors import WorldError

if TYPE_CHECKING:
    from rclpy.node import Node

RCL_RET_OK, RCL_RET_TIMEOUT = 0, 2


class _Allocator(ctypes.Structure):
    """``rcutils_allocator_t``: four functions and their state."""

    _fields_ = tuple((name, ctypes.c_void_p) for name in ("allocate", "deallocate", "reallocate", "zero_allocate", "state"))


class _WaitSet(ctypes.Structure):
    """``rcl_wait_set_t``: six arrays of pointers with their sizes, and rcl's own part."""

    _fields_ = (*((f"word_{number}", ctypes.c_void_p) for number in range(12)), ("impl", ctypes.c_void_p))


class GraphEvents:
    """The guard condition that rcl triggers whenever anything in the graph changes."""

    def __init__(self, node: Node) -> None:
        """Get ready to wait; the node has to live longer. Raises WorldError where rcl is another than expected."""
        self._rcl, self._rcutils = ctypes.CDLL("librcl.so"), ctypes.CDLL("librcutils.so")
        self._rcl.rcl_node_get_graph_guard_condition.restype = ctypes.c_void_p
        self._rcutils.rcutils_get_default_allocator.restype = _Allocator
        self._rcl.rcl_get_zero_initialized_wait_set.restype = _WaitSet
        self._rcl.rcl_wait.argtypes = (ctypes.c_void_p, ctypes.c_int64)
        self._condition = ctypes.c_void_p(self._rcl.rcl_node_get_graph_guard_condition(ctypes.c_void_p(node.handle.pointer)))
        self._set = self._rcl.rcl_get_zero_initialized_wait_set()
        sizes = (ctypes.c_size_t(number) for number in (0, 1, 0, 0, 0, 0))
        context = ctypes.c_void_p(node.context.handle.pointer)
        if not self._condition or self._rcl.rcl_wait_set_init(
            ctypes.byref(self._set), *sizes, context, self._rcutils.rcutils_get_default_allocator()
        ):
            raise WorldError("rcl gives no graph events; is this rclpy of Jazzy?")

    def wait(self, timeout_s: float) -> bool:
        """Return True as soon as the graph changes (or has since the last call), False after the time."""
        pointer = ctypes.byref(self._set)
        if self._rcl.rcl_wait_set_clear(pointer) or self._rcl.rcl_wait_set_add_guard_condition(pointer, self._condition, None):
            raise WorldError("rcl can't wait for graph events")
        result = self._rcl.rcl_wait(pointer, int(timeout_s * 1e9))
        if result not in {RCL_RET_OK, RCL_RET_TIMEOUT}:
            self._rcutils.rcutils_reset_error()
            raise WorldError(f"rcl stopped waiting for graph events ({result})")
        return bool(result == RCL_RET_OK)

    def wake(self) -> None:
        """Have ``wait`` return True, from another thread."""
        self._rcl.rcl_trigger_guard_condition(self._condition)

    def close(self) -> None:
        """Free what rcl allocated; nothing wakes any more."""
        self._rcl.rcl_wait_set_fini(ctypes.byref(self._set))
