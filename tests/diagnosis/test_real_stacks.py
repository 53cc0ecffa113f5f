"""Captures of dumpcap: real programs on the stacks of two kernels, a switch between that loses, delays, cuts.

real_stacks.zip has them with their projects; the name of each says where it was captured (at a mirror port
of that switch, or on a loopback interface), the cause, and how it was made. They send with Python's
sockets, socat, mosquitto, `python -m http.server`, OpenSSL.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import pytest

from tests.diagnosis.test_remedies import BY_A_PARAMETER
from trcvtui.cli.main import main
from trcvtui.diagnosis.causes import CAUSE_RULES

ARCHIVE = Path(__file__).with_name("real_stacks.zip")
CAUSES = sorted({"healthy", *(rule.cause for rule in CAUSE_RULES)}, key=len, reverse=True)


with ZipFile(ARCHIVE) as _archive:
    CASES = [name.partition(".")[0] for name in _archive.namelist() if name.endswith(".gz")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("real")
    with ZipFile(ARCHIVE) as archive:
        archive.extractall(made)
    return made


def findings(case: str, folder: Path, capsys: pytest.CaptureFixture[str], *sets: str) -> list[dict[str, Any]]:
    """Return what the doctor finds with the project beside the capture, the surest first."""
    project = folder / f"{case}.toml"
    beside = ["--project", str(project)] if project.exists() else []
    main(["doctor", str(folder / f"{case}.pcapng.gz"), "--format", "json", *beside, *sets])
    told = capsys.readouterr()
    found = [one for each in json.loads(told.out) for one in each["findings"]]
    return sorted(found, key=lambda one: -one["confidence"])


def label(case: str) -> str:
    if case.endswith("header-crlf-after"):
        return "frame-long"  # nothing stands before the members
    rest = case.partition("-")[2]
    return next(cause for cause in CAUSES if rest == cause or rest.startswith(f"{cause}-"))


@pytest.mark.parametrize("case", CASES)
def test_the_cause_of_a_real_capture_is_first(
    case: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    causes = [one["cause"] for one in findings(case, folder, capsys)]
    assert causes[:1] == ([] if label(case) == "healthy" else [label(case)])


@pytest.mark.parametrize("case", [one for one in CASES if label(one) in BY_A_PARAMETER])
def test_what_the_remedy_sets_takes_the_evidence_away(
    case: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first = findings(case, folder, capsys)[0]
    sets = [mend["set"] for mend in first["mend"] if mend["set"]]
    assert sets or case.endswith(("word-swap", "crlf-after"))  # the bench swaps no words, adds no members
    after = findings(case, folder, capsys, *(word for one in sets for word in ("--set", one)))
    assert after == [] or not sets
