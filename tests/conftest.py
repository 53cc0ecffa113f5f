"""What holds for every test: no property is judged by how long one example took on this machine."""

from __future__ import annotations

from hypothesis import settings

from tests.certificates import certificates

__all__ = ["certificates"]

settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")
