"""What the doctor says of a failed TLS handshake: what the block knows, each with its own remedy."""

from __future__ import annotations

import json
import re
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests import golden
from tests.bench.test_tls_blocks import (
    CLIENT,
    CONNECT,
    HEAD,
    RECEIVES,
    SERVER,
    desk_of,
    openssl,
    s_client,
    s_server,
    shows,
)
from tests.certificates import NEEDS_OPENSSL
from tests.diagnosis.truth.live_plc import LivePlc
from trcvtui.blocks.outcome import Cause, CauseKind
from trcvtui.cli.main import main
from trcvtui.diagnosis.block_symptoms import BlockSymptoms
from trcvtui.diagnosis.evidence import Evidence
from trcvtui.diagnosis.handshake import explain_handshake_failure
from trcvtui.diagnosis.job import AdvisedCause
from trcvtui.history.records import ScanStamp
from trcvtui.net.layer import TlsError
from trcvtui.snapshots.doctor import Finding

pytestmark = NEEDS_OPENSSL
OLD = "-tls1_1 -cipher ALL:@SECLEVEL=0"
BARE = CLIENT.replace("TLSClientCertRef = 2", "")
ANY_NAME = CLIENT.replace("ExtTLSCapabilities = 1", "ExtTLSCapabilities = 0")  # it bears none
WANTS = f"{shows('partner')} -Verify 1 -verify_return_error"
# Case: the CONNECT, what openssl is, the STATUS.
HANDSHAKES = {
    "a certificate of another address": (CLIENT, shows("elsewhere"), "80E1"),
    "a certificate of a stranger": (CLIENT, shows("strange"), "80E4"),
    "a certificate that has expired": (CLIENT, shows("expired"), "80E5"),
    "a certificate that is not valid yet": (ANY_NAME, shows("early"), "80E3"),
    "a critical extension": (CLIENT, shows("critical"), "80E7"),
    "a server of TLS 1.1": (CLIENT, f"{shows('partner')} {OLD}", "80E1"),
    "a server that wants a certificate, TLS 1.3": (BARE, f"{WANTS} -tls1_3", "80E1"),
    "a server that wants a certificate, TLS 1.2": (BARE, f"{WANTS} -tls1_2", "80E1"),
    "a server that does not trust ours": (CLIENT, f"{WANTS} -CAfile strangers.pem", "80E1"),
    "a client without a certificate": (SERVER, "", "80E2"),
    "a client of TLS 1.1": (SERVER, f"{shows('partner')} {OLD}", "80E1"),
    "a client that does not trust ours": (SERVER, "-CAfile strangers.pem -verify_return_error", "80E1"),
}


def symptom_of(folder: Path, connect: str, more: str, code: str) -> Finding:
    with ExitStack() as opened:
        if connect is SERVER:
            desk = opened.enter_context(desk_of(folder, connect))
            opened.enter_context(openssl(folder, s_client(desk.port(), more)))
        else:
            port, _ = opened.enter_context(s_server(folder, more))
            desk = opened.enter_context(desk_of(folder, connect.format(port=port)))
        desk.run_until(lambda: bool(desk.shown()))
        assert desk.shown() == [code]
        symptoms = BlockSymptoms(desk.bench, 0)
        for line in desk.bench.runtime.ledger:
            symptoms.add_event(line.scan, line.t_ns, line.event)
        (found,) = symptoms.list_findings(is_running=False)
        return found


def test_each_handshake_has_its_own_cause_and_remedy(secure_bench: Path) -> None:
    said = []
    for case, (connect, more, code) in HANDSHAKES.items():
        found = symptom_of(secure_bench, connect, more, code)
        assert (found.cause, found.is_fact) == ("tls-refused", True), case
        texts = [f"- {text}" for text in found.evidence[1:]] + [f"> {mend.text}" for mend in found.mend]
        said.append((case, [re.sub(r"127\.0\.0\.1:\d+", "PARTNER", text) for text in texts]))
    golden.agree("doctor", "handshakes", said)


@pytest.mark.parametrize(
    ("cause", "card", "mend"),
    [
        ((TlsError.REFUSED, "access_denied"), "refuses the handshake: access denied", "its log"),
        ((TlsError.SILENT, ""), "speaks no TLS on this port, or hangs", "correct the port"),
    ],
)
def test_what_has_no_row_of_its_own_is_told_in_the_words_of_the_partner(
    secure_bench: Path, cause: tuple[str, str], card: str, mend: str
) -> None:
    with desk_of(secure_bench, CLIENT.format(port=9)) as desk:
        (config,) = desk.bench.project.connects
    failed = Cause(CauseKind.KERNEL, "", call="session", error=cause[0], words=cause[1])
    said = explain_handshake_failure(Evidence("X", "TRCV_C", "", failed, ScanStamp(0, 0), 0, config=config))
    assert isinstance(said, AdvisedCause) and card in said.cause
    assert [mend in line.text for line in said.do] == [True]


def test_the_doctor_of_a_run_names_what_the_block_knows_before_the_alert(
    secure_bench: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = HEAD + RECEIVES + CONNECT + CLIENT
    with (
        s_server(secure_bench, shows("elsewhere")) as (port, _),
        LivePlc(text.format(port=port), secure_bench) as plc,
    ):
        plc.until(lambda: plc.bench.runtime.outputs("X").error)
        plc.run(2)
    assert main(["doctor", str(plc.recording), "--format", "json"]) == 1
    verdicts = json.loads(capsys.readouterr().out)
    (found,) = [each for one in verdicts for each in one["findings"]]
    assert (found["cause"], found["status"]) == ("tls-refused", ["80E1"])
    assert "is not valid for IP:127.0.0.1" in found["evidence"][0]
    assert "alert 42" in found["evidence"][1]
    assert "subjectAltName" in found["mend"][0]["text"]
