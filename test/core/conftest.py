"""Property-based tests: bounded, the same examples each time, whatever the machine's speed."""
from __future__ import annotations

from hypothesis import HealthCheck, settings

settings.register_profile('core', deadline=None, max_examples=30, derandomize=True,
                          suppress_health_check=[HealthCheck.too_slow])
settings.load_profile('core')
