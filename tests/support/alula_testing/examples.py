"""Properties without limits of wall clock: on a busy machine any example may take long, and speed is what benchmarks are for."""

from __future__ import annotations

from hypothesis import HealthCheck, settings

PROFILE = "alula"

settings.register_profile(PROFILE, deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile(PROFILE)
