"""The project that the lines of these tests are read against."""

from __future__ import annotations

import pytest

from tests.bench.bench_project import bench_project
from trcvtui.project.project import Project


@pytest.fixture(scope="package")
def project(tmp_path_factory: pytest.TempPathFactory) -> Project:
    return bench_project(tmp_path_factory.mktemp("bench"))
