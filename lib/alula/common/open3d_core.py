"""Open3D's compiled core, without the Python around it: ``from alula.common.open3d_core import o3d``.

``import open3d`` imports its machine learning and its viewers as well, with scikit-learn, scipy.stats and dash: three quarters of the
processor time of the import (2.6 s of 3.4), which nothing here uses. ``o3d`` is the package ``open3d`` with ``core``, ``geometry``,
``io``, ``pipelines``, ``t`` and ``utility`` only; where it has been imported as a whole before, or is built for CUDA, it is the whole.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
from pathlib import Path
from typing import Any

NAME, CORE, CPU, CUDA = "open3d", "pybind", "cpu", "cuda"
"""Up to version 0.19 the core is in a folder of the device, since 0.20 beside the package's other modules."""
PARTS = ("core", "geometry", "io", "pipelines", "t", "utility")


def _import() -> Any:
    spec = importlib.util.find_spec(NAME)
    if NAME in sys.modules or spec is None or spec.origin is None or (Path(spec.origin).parent / CUDA).is_dir():
        return importlib.import_module(NAME)
    inside = f"{NAME}.{CPU}" if (Path(spec.origin).parent / CPU).is_dir() else NAME
    package = sys.modules[NAME] = importlib.util.module_from_spec(spec)  # whose __init__ is not run
    try:
        compiled = importlib.import_module(f"{inside}.{CORE}")
    except ImportError:
        del sys.modules[NAME]
        raise
    for part in PARTS:
        setattr(package, part, getattr(compiled, part))
    return package


o3d: Any = _import()
