"""What holds for every test: no property is judged by how long one example took on this machine."""

from __future__ import annotations

from hypothesis import settings

from tests.certificates import certificates, secure_bench

__all__ = ["certificates", "secure_bench"]

settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")
