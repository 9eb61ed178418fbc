"""Properties without a time limit on one example: on a busy machine any may take long, and speed is what benchmarks are for."""

from __future__ import annotations

from hypothesis import settings

settings.register_profile("alula", deadline=None)
settings.load_profile("alula")
