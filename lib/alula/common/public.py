"""The public names: where users import a class or function from, whatever module it is defined in."""

from __future__ import annotations

import importlib
import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

T = TypeVar("T")
LazyGetattr = Callable[[str], object]
LazyDir = Callable[[], list[str]]


def public(module: str = "alula") -> Callable[[T], T]:
    """Mark a class or function as part of a public module: ``help()``, tracebacks and pickles name it by that module.

    The module has to offer it under its own name. Annotations of a class are then looked up there, too: `typing.get_type_hints` needs the
    names of the module that defines it (``vars(sys.modules[defining_module])``).
    """

    def mark(thing: T) -> T:
        thing.__module__ = module
        return thing

    return mark


def lazy_names(
    module: str, defined_in: Mapping[str, Sequence[str]], names: dict[str, object], renamed: Mapping[str, str] | None = None
) -> tuple[LazyGetattr, LazyDir]:
    """Return ``__getattr__`` and ``__dir__`` of a module whose names are imported when they are first used (PEP 562).

    Args:
        module: its name.
        defined_in: the names that it offers, by the module that defines them.
        names: the module's ``globals()``; what was imported is kept there.
        renamed: names that go with the next minor version, with what they are called now; they warn.
    """
    table = {name: place for place, several in defined_in.items() for name in several}

    def __getattr__(name: str) -> object:  # noqa: N807 - it becomes the module's
        if renamed is not None and name in renamed:
            msg = f"{module}.{name} is {module}.{renamed[name]} now; the old name goes with the next minor version"
            warnings.warn(msg, DeprecationWarning, stacklevel=2)
            return getattr(sys.modules[module], renamed[name])
        if name not in table:
            msg = f"module {module!r} has no attribute {name!r}"
            raise AttributeError(msg)
        found: object = getattr(importlib.import_module(table[name]), name)
        names[name] = found
        return found

    def __dir__() -> list[str]:  # noqa: N807 - it becomes the module's
        return sorted({*names, *table})

    return __getattr__, __dir__
