"""`add` in a Siemens project: descriptions, ADDRs, certificates, peers with TLS; `save project` of them."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.certificates import NEEDS_OPENSSL
from tests.engine.test_project_save import driven, say
from trcvtui.net.layers.iso_on_tcp import IsoSettings
from trcvtui.net.layers.tls import TlsSettings
from trcvtui.project.edit import fields_of, propose_name
from trcvtui.project.file import load_project
from trcvtui.project.keys import OFFERED_KINDS as KINDS
from trcvtui.project.project import Project
from trcvtui.tui.forms.fields import make_add

BENCH = 'dialect = "{}"\n[[data]]\nname = "rx"\ntype = "ARRAY[0..3] OF BYTE"\n'
DESCRIBED = (
    'add connect C1 type=TCON_IP_v4 bytes="00 40 00 01 0b 00 00 00 00 00 00 00 07 d0" ListenPort=0',
    'add connect C2 type=TCON_IP_RFC ID=2 LocalTSelector="16#E002" RemoteTSelector="16#E001" IsoPort=0',
    'add peer P2 remote=@C2 iso=true local_tsap="16#E001" remote_tsap="16#E002"',
    'add connect C3 type=TCON_IP_v4 ID=3 ConnectionType=19 LocalPort=2000 ListenPort=0',
    "add addr A3 rem_ip_addr=127.0.0.1 rem_port_nr=5000",
    'add addr A4 bytes="7f 00 00 01 07 d0 00 00"',
    "add instance R1 block=TRCV_C connect=C1 data=rx CONT=1",
)  # fmt: skip
SECURE = (
    "add certificate number=1 file=certificates/ca.pem",
    "add certificate 2 file=certificates/plc.pem key=certificates/plc.key",
    "add certificate 3 file=certificates/partner.pem key=certificates/partner.key",
    "add connect S type=TCON_IP_V4_SEC ListenPort=0 ActivateSecureConn=true TLSServerReqClientCert=true"
    " TLSServerCertRef=2 TLSClientCertRef=1",
    "add peer good remote=@S tls=true certificate=3 authority=1",
    'add peer lax remote=@S tls=true certificate=3 server_name=plc verify="none, this is unsafe"',
    "add instance R1 block=TRCV_C connect=S data=rx CONT=1 EN_R=1",
)


def bench_in(folder: Path, dialect: str = "s7-1500") -> Path:
    file = folder / "mine.toml"
    file.write_text(BENCH.format(dialect), encoding="utf-8")
    return file


def saved(file: Path, lines: tuple[str, ...], also: str = "save project") -> Project:
    """Add these to a bench that runs, save it, and return what the file says then."""
    for driver in driven(file):
        for line in (*lines, also):
            answer = say(driver, line).answers[-1]
            assert answer.error == "", f"{line}: {answer.error}"
    return load_project(file)


def test_descriptions_and_what_goes_with_them_are_saved_as_they_were_added(tmp_path: Path) -> None:
    project = saved(bench_in(tmp_path), DESCRIBED)
    first, iso, udp = project.connects
    assert (
        first.description is not None and first.description.data.hex() == "004000010b000000000000000" + "7d0"
    )
    assert iso.session is not None and udp.is_datagram
    assert [addr.effective_description.data.hex() for addr in project.addrs] == [
        "7f00000113880000",
        "7f00000107d00000",
    ]
    assert isinstance(project.peers[0].session, IsoSettings)


@NEEDS_OPENSSL
def test_certificates_and_peers_with_tls_are_saved_and_speak(secure_bench: Path, tmp_path: Path) -> None:
    shutil.copytree(secure_bench / "certificates", tmp_path / "certificates")
    file = bench_in(tmp_path)
    project = saved(file, SECURE)
    assert sorted(project.certificates) == [1, 2, 3] and project.connects[0].flaw is None
    good, lax = (peer.session for peer in project.peers)
    assert isinstance(good, TlsSettings) and isinstance(lax, TlsSettings)
    assert not good.is_unverified and lax.is_unverified and lax.server_name == "plc"
    assert 'verify = "none, this is unsafe"' in file.read_text(encoding="utf-8")
    for driver in driven(file):
        driver.scan(5)  # until it listens
        say(driver, "peer good connect")
        driver.scan(20)
        say(driver, "peer good send hex 01 02 03 04")
        driver.scan(5)
        picture = say(driver)
        assert picture.snapshot.instances[0].jobs_done == 1


@NEEDS_OPENSSL
def test_a_copy_elsewhere_still_finds_its_certificates(secure_bench: Path, tmp_path: Path) -> None:
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    bench = secure_bench / "mine.toml"
    text = (secure_bench / "tls-client.toml").read_text(encoding="utf-8").partition("[scenario]")[0]
    bench.write_text(text, encoding="utf-8")
    saved(bench, ("add data more INT",), f"save project {folder / 'copy.toml'}")
    copy = load_project(folder / "copy.toml")
    assert {Path(one.file).resolve() for one in copy.certificates.values()} == {
        Path(one.file).resolve() for one in load_project(bench).certificates.values()
    }


def test_a_certificate_whose_number_is_taken_or_whose_file_is_none_is_one_line(tmp_path: Path) -> None:
    for driver in driven(bench_in(tmp_path)):
        answer = say(driver, "add certificate 1 file=nothing.pem").answers[-1]
        assert "certificate 1: file: found" in answer.error and "expected a PEM file" in answer.error


@pytest.mark.parametrize("dialect", ["s7-1500", "s7-1200", "s7-1200-legacy", "baosky"])
def test_the_form_offers_a_connection_what_its_dialect_takes(dialect: str, tmp_path: Path) -> None:
    file = bench_in(tmp_path, dialect)
    project = load_project(file)
    keys = {field.key for field in fields_of("connect", project)}
    assert ("SendDelayOpt" in keys) == (dialect == "baosky")
    assert ({"type", "bytes"} <= keys) == (dialect != "baosky")
    for kind in KINDS:
        if kind in ("connect", "addr", "peer"):
            first = {field.key: field.first for field in fields_of(kind, project)}
            saved(file, (make_add(kind, propose_name(kind, load_project(file)), first, project),))


@pytest.mark.parametrize("written", ["E002", '"E0 02"'])
def test_a_line_refuses_a_tsap_that_could_be_hex_or_text_with_both(written: str, tmp_path: Path) -> None:
    text = written.strip('"')
    told = f'found \'{text}\', expected "16#E002" (the bytes E0 02) or "text:{text}" (the text)'
    lines = (
        f"add connect C2 type=TCON_IP_RFC LocalTSelector={written} IsoPort=0",
        f"add peer P2 iso=true local_tsap={written}",
    )
    for driver in driven(bench_in(tmp_path)):
        assert all(told in say(driver, line).answers[-1].error for line in lines)
