"""An instance as its call in Structured Text, as it stands at the end of the manual's pages."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests import golden
from tests.bench.bench_lines import do
from trcvtui.bench.bench import Bench
from trcvtui.blocks.table import BLOCKS
from trcvtui.cli.main import main
from trcvtui.commands.table import collect_written_data, parse_script
from trcvtui.dialects import DIALECTS
from trcvtui.errors import UserError
from trcvtui.plc.ledger import StatusEdge
from trcvtui.project.file import load_project
from trcvtui.project.project import Project
from trcvtui.project.st_call import CallForm, st_call, st_text, st_variables

Capture = pytest.CaptureFixture[str]
DATA = """
[[data]]
name = "tx"
type = "ARRAY[0..7]  OF BYTE"
"""
UDP = """
[[udp_config]]
name = "U1"
LocalAddress = "10.0.0.1"
LocalPort = 2005

[[addr]]
name = "A1"
RemoteAddress = "10.0.0.7"
RemotePort = 2006
"""
HEAD = f"""\
dialect = "baosky"
{DATA}
[[connect]]
name = "C1"
ActiveEstablished = true
LocalAddress = "127.0.0.1"
LocalPort = 0
RemoteAddress = "10.0.0.7"
RemotePort = 2001
SendDelayOpt = true
KeepAliveTimeInterval = 3
{UDP}"""


def project(folder: Path, *instances: str, head: str = HEAD) -> Project:
    file = folder / "bench.toml"
    file.write_text(head + "".join(f"\n[[instance]]\n{text}\n" for text in instances), encoding="utf-8")
    return load_project(file)


def instance(name: str, block: str, *lines: str) -> str:
    bound = ['data = "tx"'] if BLOCKS[block].data_pin else []
    link = ['config = "U1"', 'addr = "A1"'] if BLOCKS[block].speaks_udp else ['connect = "C1"']
    if BLOCKS[block].has_com_buffer:
        link = [
            f'{BLOCKS[block].buffer_pin} = "B1"',
            *(f'{pointer} = "tx"' for pointer in BLOCKS[block].pointers),
        ]
    return "\n".join([f'name = "{name}"', f'block = "{block}"', *link, *bound, *lines])


def test_a_call_binds_every_pin_in_the_order_of_the_manual(tmp_path: Path) -> None:
    def call(case: str) -> list[str]:
        block, _, line = case.partition(" ")
        return st_call(project(tmp_path, instance("X", block, line)), "X").splitlines()

    golden.answers("calls", call, "st_calls")


def test_the_present_inputs_stand_as_literals(tmp_path: Path) -> None:
    bench = project(tmp_path, instance("R", "TRCV_C", "CONT = true", "LEN = 4"))
    call = st_call(bench, "R", {"CONT": False, "EN_R": True, "ADHOC": 1, "COM_RST": True})
    assert re.findall(r"(\w+):=(TRUE|FALSE|\d+)\b", call) == [
        ("EN_R", "TRUE"),
        ("CONT", "FALSE"),
        ("LEN", "4"),
        ("ADHOC", "TRUE"),
    ]


NDR = {("TURCV", "DONE"): "NDR"}  # what the manual of the block calls it


def head_of(block: str) -> str:
    if block in DIALECTS["baosky"].blocks:
        return HEAD
    if BLOCKS[block].has_com_buffer:
        return f'dialect = "twincat"\n{DATA}\n[[combuffer]]\nname = "B1"\n'
    return f'dialect = "s7-1500"\n{DATA}\n[[connect]]\nname = "C1"\n{UDP}'


@pytest.mark.parametrize("block", BLOCKS)
def test_each_block_has_its_own_pins_and_data_only_where_it_moves_bytes(block: str, tmp_path: Path) -> None:
    call = st_call(project(tmp_path, instance("X", block), head=head_of(block)), "X")
    bound = re.findall(r"^ +(\w+)(:=|=>)", call, re.MULTILINE)
    link = (
        {"CONFIG" if block in DIALECTS["baosky"].blocks else "ID", "ADDR"}
        if BLOCKS[block].speaks_udp
        else {BLOCKS[block].buffer_pin or "CONNECT"}
    )
    link = {"ID"} if block == "T_DIAG" else link
    own = {NDR.get((block, pin.name), pin.name) for pin in BLOCKS[block].pins} - {"EN"} | {
        *BLOCKS[block].pointers
    }
    names = own | link | ({BLOCKS[block].data_pin} - {""})
    assert {name for name, _ in bound} == names and len(bound) == len(names)
    assert [mark for _, mark in bound] == sorted(mark for _, mark in bound)
    assert call.count(",\n") == len(bound) - 1


def test_an_open_data_pin_is_left_out_and_said(tmp_path: Path) -> None:
    bench = project(tmp_path, 'name = "R"\nblock = "TRCV_C"\nconnect = "C1"')
    call = st_call(bench, "R")
    assert call.startswith("R( (* DATA is not bound *)\n")
    assert "DATA:=" not in call


def test_the_variables_stand_above_the_calls_and_a_shared_one_once(tmp_path: Path) -> None:
    def variables(case: str) -> list[str]:
        names = [f"I{n}" for n, _ in enumerate(case.split())]
        return st_variables(project(tmp_path, *map(instance, names, case.split())), names).splitlines()

    golden.answers("variables", variables, "st_calls")
    bench = project(tmp_path, instance("S", "TSEND_C"), instance("D", "TDISCON"))
    comment, first, second = st_text(bench, ["S", "D"], {"D": {"REQ": True}}).split("\n\n")
    assert comment == st_variables(bench, ["S", "D"])
    assert (first, second) == (st_call(bench, "S"), st_call(bench, "D", {"REQ": True}))
    assert "REQ:=TRUE" in second


def test_every_variable_of_a_call_is_declared(tmp_path: Path) -> None:
    blocks = DIALECTS["baosky"].blocks
    names = [f"I{n}" for n in range(len(blocks))]
    bench = project(tmp_path, *map(instance, names, blocks))
    declared = set(re.findall(r"^    (\w+) : ", st_variables(bench, names), re.MULTILINE))
    used = {
        word
        for name in names
        for word in re.findall(r"(?::=|=>)([A-Za-z]\w*)", st_call(bench, name))
        if word not in ("TRUE", "FALSE")
    }
    assert used <= declared


def test_a_remote_port_that_names_a_peer_is_left_out(tmp_path: Path) -> None:
    peer = '\n[[peer]]\nname = "P1"\nactive = false\nlocal = "127.0.0.1:0"\n'
    head = HEAD.replace("RemotePort = 2001", 'RemotePort = "@P1"') + peer
    text = st_variables(project(tmp_path, instance("S", "TSEND_C"), head=head), ["S"])
    assert "RemotePort" not in text and "RemoteAddress" in text


STARTS = {
    "ARRAY[0..1] OF BYTE": ("hex 0d 0a", "[16#0D, 16#0A]"),
    "ARRAY[0..7] OF BYTE": ("hex 0d", "[16#0D, 7(16#00)]"),
    "ARRAY[0..1,0..1] OF INT": ("hex 01 00 ff ff 03 00 04 00", "[1, -1, 3, 4]"),
    "ARRAY[0..2] OF BOOL": ("hex 01 00 01", "[TRUE, FALSE, TRUE]"),
    "BYTE": ("13", "16#0D"),
    "WORD": ("4660", "16#1234"),
    "BOOL": ("TRUE", "TRUE"),
    "TIME": ("T#1s500ms", "T#1s500ms"),
    "REAL": ("1e-7", "1.0e-07"),
    "STRING[10]": ("'a*)$R$$b(*'", "'a$2A)$0D$$b($2A'"),
    "WSTRING[4]": ("hex 41 00 0d 00 22 00", '"A$000D$""'),
    "Message": ("{a=1, text='x'}", "(a := 1, text := 'x', b := [16#00, 16#00])"),
    "INT": ("0", ""),
}


@pytest.mark.parametrize("type_name", STARTS)
def test_what_start_writes_is_the_initial_value(type_name: str, tmp_path: Path, capsys: Capture) -> None:
    written, value = STARTS[type_name]
    (tmp_path / "m.st").write_text(
        "TYPE Message : STRUCT a : INT; text : STRING[3]; b : ARRAY[0..1] OF BYTE; END_STRUCT END_TYPE"
    )
    file = tmp_path / "line.toml"
    file.write_text(
        f'dialect = "twincat"\nstart = """\nwrite mark {written}\n"""\n[[udt]]\nfile = "m.st"\n'
        f'[[combuffer]]\nname = "RX"\n[[data]]\nname = "text"\ntype = "ARRAY[0..31] OF BYTE"\n'
        f'[[data]]\nname = "mark"\ntype = "{type_name}"\n[[instance]]\nname = "RD"\nblock = "ReceiveData"\n'
        'RxBuffer = "RX"\ndata = "text"\npSuffix = "mark"\nLenSuffix = 2\n',
        encoding="utf-8",
    )
    assert main(["st", str(file)]) == 0
    assert f"    mark : {type_name}{' := ' * bool(value)}{value};\n" in capsys.readouterr().out


def test_several_parts_that_start_writes_make_one_value(tmp_path: Path) -> None:
    bench = project(tmp_path, instance("R", "TRCV_C"))
    steps = parse_script(
        "write tx hex 0d\nwrite tx+1 hex 0a\nwrite tx+7 hex ff\nwrite tx hex 0e", bench, "start"
    )
    form = CallForm(written=collect_written_data(steps, bench))
    assert "tx : ARRAY[0..7] OF BYTE := [16#0E, 16#0A, 5(16#00), 16#FF];" in st_variables(bench, ["R"], form)


def test_scl_has_its_own_texts_and_dates(tmp_path: Path) -> None:
    (tmp_path / "m.st").write_text(
        "TYPE M : STRUCT w : WSTRING[4]; c : WCHAR; s : STRING[4]; d : DT; l : DTL; END_STRUCT END_TYPE"
    )
    head = SIEMENS.replace('"ARRAY[0..7]  OF BYTE"', '"M"').replace(
        "\n[[data]]", '[[udt]]\nfile = "m.st"\n[[data]]'
    )
    bench = project(tmp_path, instance("R", "TRCV_C"), head=head)
    steps = parse_script("write tx.w 'a\"ä'\nwrite tx.s 'a'", bench, "start")
    text = st_variables(bench, ["R"], CallForm(written=collect_written_data(steps, bench)))
    assert """(w := WSTRING#'a"$00E4', c := WCHAR#'$0000', s := 'a', """ in text
    assert "d := DT#1990-01-01-00:00:00, l := DTL#1970-01-01-00:00:00);" in text


def test_st_prints_one_instance_or_all(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bench = project(tmp_path, instance("S", "TSEND_C"), instance("R", "TRCV_C"))
    assert main(["st", str(bench.path), "R"]) == 0
    assert capsys.readouterr().out == st_text(bench, ["R"]) + "\n"
    assert main(["st", str(bench.path)]) == 0
    assert capsys.readouterr().out == st_text(bench, ["S", "R"]) + "\n"
    assert main(["st", str(bench.path), "X"]) == 2
    out, err = capsys.readouterr()
    assert (out, err) == ("", "INSTANCE: found 'X', expected one of S, R\n")


SIEMENS = f"""dialect = "s7-1500"
{DATA}
[[connect]]
name = "C1"
ID = 7
ActiveEstablished = true
RemoteAddress = "10.0.0.7"
RemotePort = "@P1"

[[connect]]
name = "SHORT"
type = "TCON_IP_RFC"
bytes = "00 40 00 01 0c 01 00 00 0a 00 00 07 00 02"

[[connect]]
name = "NONE"
bytes = ""

[[connect]]
name = "LONG_TSAP"
bytes = "00 40 00 02 0c 00 00 00 00 00 00 00 00 28 {"e0 " * 32} 00 02 e0 01 {"00 " * 30}"

[[udp_config]]
name = "U1"

[[addr]]
name = "A1"
rem_ip_addr = "10.0.0.7"
rem_port_nr = "@P2"

[[addr]]
name = "SEVEN"
type = "TADDR_Param"
bytes = "0a 00 00 07 07 d0 00"

[[peer]]
name = "P1"

[[peer]]
name = "P2"
udp = true
"""


def test_tcon_has_the_id_and_the_description_and_baosky_has_no_id(tmp_path: Path) -> None:
    call = st_call(project(tmp_path, instance("X", "TCON"), head=SIEMENS), "X")
    assert "    ID:=7,\n    CONNECT:=C1,\n" in call
    assert "ID:=" not in st_call(project(tmp_path, instance("X", "TCON")), "X")


def test_a_short_text_names_what_differs_from_a_default(tmp_path: Path) -> None:
    def text(case: str) -> list[str]:
        flags, block, *lines = case.split("; ")
        head = SIEMENS if "s7" in flags else head_of(block)
        bench = project(tmp_path, instance("X", block, *lines), head=head)
        return st_text(bench, ["X"], form=CallForm("short" in flags, "multi" in flags)).splitlines()

    golden.answers("forms", text, "st_calls")


def test_no_other_vendor_has_a_multi_instance(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="st --multi: found baosky, expected a dialect"):
        st_text(project(tmp_path, instance("X", "TSEND_C")), ["X"], form=CallForm(is_multi=True))


@pytest.mark.parametrize("flags", [(), ("--short",), ("--short", "--multi")])
def test_st_takes_the_form_of_a_call(flags: tuple[str, ...], tmp_path: Path, capsys: Capture) -> None:
    bench = project(tmp_path, instance("X", "TRCV"), head=SIEMENS)
    assert main(["st", str(bench.path), *flags]) == 0
    form = CallForm("--short" in flags, "--multi" in flags)
    assert capsys.readouterr().out == st_text(bench, ["X"], form=form) + "\n"


def test_addr_of_tsend_and_trcv_is_there_and_does_nothing(tmp_path: Path) -> None:
    names = {"S": "TSEND", "R": "TRCV", "T": "TCON"}
    head = SIEMENS.replace("RemotePort", 'LocalAddress = "127.0.0.1"\nRemotePort')
    head = head.replace('RemoteAddress = "10.0.0.7"', 'RemoteAddress = "127.0.0.1"')
    parts = [instance(name, block, *['addr = "SEVEN"'] * (block != "TCON")) for name, block in names.items()]
    bench = Bench(project(tmp_path, *parts, head=head), "sim")
    assert all("ADDR:=SEVEN" in st_call(bench.project, name) for name in "SR")
    do(bench, "pulse T REQ", scans=5)
    do(bench, "pulse S REQ", "set R EN_R=1", "peer P1 send hex 01 02 03 04 05 06 07 08", scans=5)
    edges = [line.event for line in bench.runtime.ledger if isinstance(line.event, StatusEdge)]
    jobs = [bench.runtime.snapshot().instance(name) for name in "SR"]
    assert not any(edge.outputs.error for edge in edges) and [one and one.jobs_done for one in jobs] == [1, 1]
    bench.close()


def test_a_udp_block_of_siemens_is_given_an_id_and_a_taddr_param(tmp_path: Path) -> None:
    bench = project(tmp_path, 'name = "S"\nblock = "TUSEND"\nconfig = "U1"\naddr = "A1"', head=SIEMENS)
    text = st_text(bench, ["S"])
    assert "    U1_ID : CONN_OUC;  // ID of the configured connection" in text
    assert "    A1 : TADDR_Param := (\n        rem_ip_addr := [10, 0, 0, 7],\n" in text
    assert "        rem_port_nr := 0,  // where @P2 listens\n" in text and "ID:=U1_ID," in text
    assert "UDP_CONFIG" not in text and "ADDR_PARAM" not in text


def test_bytes_that_fill_no_structure_stay_bytes_and_say_why(tmp_path: Path) -> None:
    names = ("SHORT", "NONE")
    bench = project(
        tmp_path, *(f'name = "X_{n}"\nblock = "TSEND_C"\nconnect = "{n}"' for n in names), head=SIEMENS
    )
    text = st_variables(bench, ["X_SHORT", "X_NONE"])
    assert (
        "SHORT : ARRAY[0..13] OF BYTE := [  // a CPU refuses this: 14 bytes, but TCON_IP_RFC has 80" in text
    )
    assert "16#00, 16#40, 16#00, 16#01, 16#0C, 16#01, 16#00, 16#00,\n" in text
    assert "// NONE holds no byte: 0 bytes are no connection description" in text
    assert "TSelLength" not in text and "TCON_" not in text.replace("TCON_IP_RFC has", "")


def test_a_length_that_does_not_fit_its_selector_is_not_mended(tmp_path: Path) -> None:
    bench = project(tmp_path, 'name = "X"\nblock = "TSEND_C"\nconnect = "LONG_TSAP"', head=SIEMENS)
    line = next(line for line in st_variables(bench, ["X"]).splitlines() if "RemoteTSelector" in line)
    assert "(TSelLength := 40, TSel := [" in line and "// a CPU refuses this: TSelLength is 40" in line


def test_seven_bytes_at_addr_stay_seven_bytes(tmp_path: Path) -> None:
    bench = project(tmp_path, 'name = "S"\nblock = "TUSEND"\nconfig = "U1"\naddr = "SEVEN"', head=SIEMENS)
    assert (
        "SEVEN : ARRAY[0..6] OF BYTE := [  // a CPU refuses this: 7 bytes, TADDR_Param has 8"
        in st_variables(bench, ["S"])
    )


def test_older_instructions_have_a_uint_for_len_and_rcvd_len(tmp_path: Path) -> None:
    head = f'dialect = "s7-1200-legacy"\n{DATA}\n[[connect]]\nname = "C1"\n'
    bench = project(tmp_path, instance("R", "TRCV_C", "LEN = 65535"), head=head)
    assert "R_RCVD_LEN : UINT;" in st_variables(bench, ["R"])
    with pytest.raises(UserError, match="LEN: found 65536, expected"):
        project(tmp_path, instance("R", "TRCV_C", "LEN = 65536"), head=head)


# -- blocks on a ComBuffer -----------------------------------------------------------------------------------


def line_bench(folder: Path) -> Project:
    """Return a project whose ComBuffer and variable differ in their case alone, as the shipped ones do."""
    parts = (
        '[[combuffer]]\nname = "RX"\n',
        '[[data]]\nname = "rx"\ntype = "ARRAY[0..3] OF BYTE"\n',
        '[[instance]]\nname = "RD"\nblock = "ReceiveData"\nRxBuffer = "RX"\ndata = "rx"\n',
        '[[instance]]\nname = "SB"\nblock = "SendByte"\nTxBuffer = "RX"\nSendByte = 7\n',
        '[[instance]]\nname = "CL"\nblock = "ClearComBuffer"\nBuffer = "RX"\n',
    )
    file = folder / "line.toml"
    file.write_text('dialect = "twincat"\n' + "\n".join(parts), encoding="utf-8")
    return load_project(file)


def test_no_two_variables_of_a_text_differ_in_their_case_alone(tmp_path: Path) -> None:
    text = st_text(line_bench(tmp_path), ["RD", "SB", "CL"])
    declared = [name.casefold() for name in re.findall(r"^    (\w+) : ", text, re.MULTILINE)]
    assert len(set(declared)) == len(declared)
    assert "    RX_Buffer : ComBuffer;" in text and "    rx : ARRAY[0..3] OF BYTE;" in text
    assert "    RxBuffer:=RX_Buffer,\n    pReceiveData:=ADR(rx)," in text
    assert "        TxBuffer:=RX_Buffer,\n" in text


def test_error_is_a_comerror_t_as_the_manual_declares_it(tmp_path: Path) -> None:
    assert "    RD_Error : ComError_t;" in st_text(line_bench(tmp_path), ["RD"])


@pytest.mark.parametrize(("name", "does"), [("SB", "sends"), ("CL", "clears")])
def test_a_block_that_acts_at_every_call_is_called_under_a_variable(
    name: str, does: str, tmp_path: Path
) -> None:
    text = st_text(line_bench(tmp_path), [name])
    assert f"    {name}_EN : BOOL;" in text
    assert f"\n\nIF {name}_EN THEN (* every call {does} *)\n    {name}(\n        " in text
    assert text.endswith("\n    );\nEND_IF")
    assert "EN:=" not in text
