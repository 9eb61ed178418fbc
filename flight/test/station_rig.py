"""A part of a deployment that runs until it is ended, for tests of what stays up between missions."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from alula_flight.station.parts import Part

ROOT = Path(__file__).resolve().parents[2]


def sleeper(**environment):
    words = (sys.executable, "-c", "import time; print('here', flush=True); time.sleep(1000)")
    return Part("bridge", words, {**os.environ, **environment})
