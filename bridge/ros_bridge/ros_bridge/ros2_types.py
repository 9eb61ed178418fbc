"""ROS 2's classes of messages, services and actions, by their names ``package/Name``, and the type supports behind them."""

from __future__ import annotations

import ctypes
import importlib
from ctypes import c_char_p, c_void_p
from typing import Any

from rclpy.type_support import check_for_type_support

from ros_bridge.errors import TypeUnknownError


def interface_class(package_and_name: str, kind: str) -> Any:
    """Return ROS 2's class of a message (kind ``msg``), service (``srv``) or action (``action``).

    Raises:
        TypeUnknownError: It is not installed.
    """
    package, name = package_and_name.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.{kind}"), name)
    except (ImportError, AttributeError) as error:
        raise TypeUnknownError(f"{package}/{kind}/{name} is not installed in the ROS 2 world: build or install {package}") from error


def type_support_of(interface: Any) -> int:
    """Return the address of the type support that rclpy uses for a message or service class."""
    check_for_type_support(interface)
    capsule = interface.__class__._TYPE_SUPPORT  # noqa: SLF001 - rclpy reads it the same way
    get_name, get_pointer = ctypes.pythonapi.PyCapsule_GetName, ctypes.pythonapi.PyCapsule_GetPointer
    get_name.restype, get_name.argtypes = c_char_p, [ctypes.py_object]
    get_pointer.restype, get_pointer.argtypes = c_void_p, [ctypes.py_object, c_char_p]
    return int(get_pointer(capsule, get_name(capsule)))
