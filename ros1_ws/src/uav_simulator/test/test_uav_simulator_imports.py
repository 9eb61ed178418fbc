"""What a node imports is paid at each start of it, and on a vehicle."""

from __future__ import annotations

import subprocess
import sys

import pytest

UNUSED = ("sklearn", "scipy.stats", "dash", "open3d.ml", "open3d.visualization")
BOTH = "import alula.common.open3d_core as a, open3d; assert a.o3d is open3d; open3d.core.Tensor([1]); open3d.io; open3d.t.geometry"


@pytest.mark.parametrize("module", ["uav_simulator.world.scene", "uav_report.world", "uav_report.map_quality"])
def test_nothing_of_open3d_is_imported_that_is_not_used(module: str) -> None:
    code = f"import {module}, sys; assert 'open3d' in sys.modules; print(*(set({UNUSED}) & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.strip()) == (0, ""), done.stderr


def test_the_mapping_imports_no_open3d() -> None:
    code = "import lidar_mapping.node, sys; assert 'open3d' not in sys.modules"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("first", ["", "import open3d, sys; assert 'open3d.visualization' in sys.modules; "])
def test_it_is_one_package_whichever_is_imported_first(first: str) -> None:
    done = subprocess.run([sys.executable, "-c", first + BOTH], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
