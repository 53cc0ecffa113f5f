"""The mismatch story: what the receiver got names the layout of the sender, and the cure is its type."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.scenario.scenarios import CONFIGS
from trcvtui.bench.bench import Bench
from trcvtui.commands.table import parse_line, parse_script
from trcvtui.commands.words import PeerSend
from trcvtui.project.file import load_project
from trcvtui.project.project import Project
from trcvtui.scenario.runner import ScenarioRunner, VirtualPace
from trcvtui.udt.compare.fit import rank, tied_readings, verdict
from trcvtui.udt.cure.padded_type import padded_type
from trcvtui.udt.layout.layout import lay_out
from trcvtui.udt.layout.values import decode
from trcvtui.udt.st_write import st_text

SEND = "peer Drive send udt AxisReport {axis=1, position=12.5}"


@pytest.fixture
def project() -> Project:
    return load_project(CONFIGS / "udt-mismatch.toml")


@pytest.fixture
def jobs(project: Project) -> list[bytes]:
    """Return what four jobs of TRCV_C_1 put into DATA: pieces of one stream, cut in the receiver's size."""
    bench, found = Bench(project, "sim"), list[bytes]()
    runner = ScenarioRunner(bench, "story", VirtualPace(), lambda *_: None)
    assert runner.play(parse_script(project.start, project, "start")).failures == ()
    for _ in range(4):
        steps = parse_script("wait TRCV_C_1 STATUS=7008\nrun 1", project, "steps")
        assert runner.play(steps).failures == ()
        found.append(bench.runtime.data("report"))
    bench.close()
    return found


def test_the_lab_names_the_layout_of_the_sender(project: Project, jobs: list[bytes]) -> None:
    fits = rank(project.types.get_type("AxisReport"), jobs, framed=False)
    assert [str(profile) for best in tied_readings(fits) for profile in best.profiles] == [
        "natural8, little-endian",
        "codesys-8, little-endian",
    ]
    assert verdict(fits).startswith("natural8, little-endian")


def test_the_corrective_type_of_the_lab_is_the_one_that_cures_the_story(
    project: Project, jobs: list[bytes]
) -> None:
    best = rank(project.types.get_type("AxisReport"), jobs, framed=False)[0]
    cure = padded_type(best.layout, project.layout)
    assert cure.is_possible
    assert st_text(cure.type) in (CONFIGS / "types" / "axis-report.st").read_text()
    declared = lay_out(project.types.get_type("AxisReport_natural8"), project.layout)
    shown = dict(
        zip((leaf.path for leaf in declared.leaves()), decode(declared, b"".join(jobs)), strict=True)
    )
    assert (shown["axis"], shown["position"], shown["speed"], shown["counter"]) == (1, 12.5, 250, 1)


def test_a_peer_lays_out_what_it_sends_as_its_own_device_does(project: Project) -> None:
    sent = parse_line(SEND, project, "step")
    assert isinstance(sent, PeerSend)
    assert sent.payload.hex(" ") == "01 00 00 00 00 00 00 00 00 00 00 00 00 00 29 40" + " 00" * 8


def test_a_peer_of_the_other_byte_order_swaps_what_it_sends(tmp_path: Path) -> None:
    text = (CONFIGS / "udt-mismatch.toml").read_text().replace("natural8", "s7-standard")
    text = text.replace("types/axis-report.st", str(CONFIGS / "types" / "axis-report.st"))
    for order, start in (("", "01 00 40 29"), ('byte_order = "little"\n', "01 00 00 00")):
        (tmp_path / "p.toml").write_text(text.replace('reconnect = "T#200ms"\n', order))
        sent = parse_line(SEND, load_project(tmp_path / "p.toml"), "step")
        assert isinstance(sent, PeerSend)
        assert sent.payload.hex(" ").startswith(start)
