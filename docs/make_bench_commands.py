"""Write `docs/bench-commands.md`: the lines that a bench takes, each verb of the program: `make atlas`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from trcvtui.commands.counters_and_checksums import FILL_KINDS as FILLS
from trcvtui.commands.peer import ALL_PEER_VERBS as PEER_VERBS
from trcvtui.commands.peer import TIMING
from trcvtui.commands.table import COMMANDS
from trcvtui.commands.tokens import FORMS
from trcvtui.net.faults import DEFAULT_ERROR
from trcvtui.project.keys import OFFERED_KINDS, TABLES
from trcvtui.tui.completion import SCREEN_COMMANDS

PAGE: Final = Path(__file__).parent / "bench-commands.md"
Row = tuple[str, str]  # example lines, each in back ticks, and what they do
HEAD: Final = """\
# Bench commands

The prompt (`:`), a scenario's `steps` and a project's `start` take the same lines. Every toggle and button of
the screen sends one of them and shows it. `tab` completes a line in the prompt.

- A line that is not understood changes nothing. The answer names the place, what was found there and what
  was expected.
- The names in the examples are those of a project: TRCV_C_1 is an instance, C1 a CONNECT, rx a DATA,
  P1 a peer, RX a ComBuffer, T a tap.
- A row that begins with "Screen" is for the prompt alone, one with "Scenario" for scenarios alone.
  `start` takes only lines that let no scan pass.

`make atlas` writes this page.
"""
SECTIONS: Final[dict[str, Sequence[Row]]] = {
    "Inputs and DATA": (
        ("`set TRCV_C_1 CONT=1 EN_R=1 LEN=4`", "Writes inputs. `REQ=blink` toggles the input in each scan."),
        ("`pulse TRCV_C_1 COM_RST`", "Sets an input to TRUE for one scan."),
        ("`write rx hex 01 02` · `write report.weight 2.5`", "Writes bytes, or one member, into DATA."),
        ("`plc stop` · `plc run`", "Switches the CPU to STOP; switches it back to RUN."),
    ),
    "The running program": (
        (
            "`create TSEND_C S2 connect=C1 data=tx`",
            "Makes an instance in the running program.",
        ),
        ("`delete S2`", "Deletes an instance from the running program."),
        ("`download S2`", "Downloads an instance again, as after a changed initial value. Its inputs stay."),
        ("`resize tx STRING[20]`", "Gives a DATA another type."),
        (
            "`udt reload`",
            "Screen: reads the UDT files again, and also reads files whose `[[udt]]` you have added to the "
            "project.",
        ),
        ("`udt constant GVL.MAX=10`", "Screen: sets a constant that the UDTs use; `save project` saves it."),
    ),
    "Parts of the project": (
        (
            "`add connect C3 LocalPort=2001`",
            "Adds a part to the project. Its keys are those of the [project file](project-file.md).",
        ),
        (
            '`add connect C4 type=TCON_IP_RFC LocalTSelector="16#E002"`',
            "Siemens: adds a connection, described by fields.",
        ),
        (
            '`add connect C5 bytes="00 40 00 01 ..."`',
            "Siemens: adds a connection, described by the bytes of its DB.",
        ),
        ("`add data rx2 ARRAY[0..9] OF BYTE`", "Adds a DATA with its type."),
        (
            "`add instance R2 block=TRCV_C connect=C3 data=rx2 CONT=1`",
            "Adds an instance. If the line leaves out the CONNECT (or UDP_CONFIG and ADDR, or ComBuffer), it "
            "is created, and DATA with it. `data=new` or `connect=new` creates one, too.",
        ),
        (
            "`add combuffer B1 source=serial port=/dev/ttyUSB0 baud=19200`",
            "Adds a ComBuffer on a serial line.",
        ),
        (
            "`add instance RD2 block=ReceiveData RxBuffer=B1 data=rx2 pSuffix=suffix SizeReceiveData=10`",
            "Adds a TwinCAT block on a ComBuffer.",
        ),
        ("`add udp_config U2` · `add addr A2`", "Adds the parts that a UDP block needs."),
        ("`add peer P3 remote=@C3`", "Adds a partner that connects to the address at which C3 listens."),
        ("`add certificate 3 file=plc.pem key=plc.key`", "Adds a certificate and its key as number 3."),
        (
            "`add peer P4 remote=@C4 tls=true certificate=3 authority=3`",
            "Adds a partner that speaks TLS.",
        ),
        (
            '`add message hi text "hi" split=1` · `add sequence s hi T#1s hi`',
            "Adds a message to the library; adds a sequence of messages.",
        ),
        (
            "`add udt types/order.st`",
            "Adds a type file. The answer lists its types, their sizes and the sender's layout. The rest of "
            "the line is the file's name, without quotes. A file can be added only once.",
        ),
        (
            "`set C2 LocalPort=2500` · `set rx ARRAY[0..99] OF BYTE` · `set P1 reconnect=T#1s`",
            "Sets keys of a part; `KEY=` removes a key. Inputs stay. The prompt and the answer list what "
            "restarts.",
        ),
        (
            '`set connect C2 LocalPort=2500` · `set message hi text "ho"` · `set instance TRCV_C_1 data=rx`',
            "The same, with the kind of the part. It is needed if two parts have the same name.",
        ),
        (
            "`remove C2` · `remove connect C2`",
            "Removes a part. If other parts use it, the line is refused and lists them.",
        ),
        (
            "`undo`",
            "Takes back the newest `add`, `remove` or `set` of a part; can be repeated, up to 20 times. "
            "Inputs and traffic stay.",
        ),
        (
            "`save project`",
            "Screen: writes into the project file what `add`, `remove`, `set` of a part and `udt constant` "
            "have changed. Comments and order stay. Missing type files are written again.",
        ),
        (
            "`save project FILE` · `save project FILE !`",
            "Screen: writes the project, with the comments of its file, into FILE. `!` overwrites an "
            "existing FILE. "
            "`save project !` writes the project's own file even if it is now gone, broken or another "
            "project.",
        ),
    ),
    "The partner": (
        ("`peer P1 connect` · `peer P2 listen`", "Tries once to connect; begins to listen."),
        ("`peer P1 close` · `peer P1 rst`", "Closes with FIN; closes with RST."),
        ("`peer P1 shutdown`", "Half-close: sends FIN and still receives."),
        ("`peer P1 stall` · `peer P1 resume`", "Stops reading, so that the TCP window closes; reads again."),
        (
            '`peer P1 send hex 01 02` · `peer P1 send text "abc"` · `peer P1 send random 100 seed=1`',
            "Sends bytes. Forms and options are [below](#what-a-peer-sends).",
        ),
        ("`peer P1 send udt Weight {state=1}` · `peer P1 send file x.bin`", "Sends a UDT, or a file."),
        ("`peer P1 send udt STRUCT a : INT; END_STRUCT {a=1}`", "Sends a UDT that the line itself declares."),
        ("`peer P1 send message hello`", "Sends a named message of the project."),
        ("`peer P1 play start`", "Plays a sequence of messages and pauses over one connection."),
        (
            "`peer P1 reply on contains hex 05 send hex 06`",
            "Adds a rule by which the peer answers what it receives: it `contains` or `starts` with these "
            "bytes, or a `field` of a UDT has a value. `{n}` in the answer is a counter; checksums are "
            "filled in.",
        ),
        ("`peer P1 reply off`", "Removes all rules; `reply off 2` removes only rule 2."),
        (
            "`peer P1 try-splits hex 01 02 03 on TRCV_C_1`",
            "Sends the message whole, then in two pieces, once for each cut, and lists the "
            "results. `gap=T#30ms` is the pause between the pieces. In a scenario, `differ=0`: "
            "no result may differ.",
        ),
        ("`peer P1 try-splits stop`", "Ends this trial."),
        (
            "`peer P1 check on size=64 every=T#100ms on TRCV_C_1`",
            "Sends frames with a number and a CRC. DATA and the bytes that come back are checked for lost, "
            "doubled and shifted frames.",
        ),
        ("`peer P1 check off`", "Ends this check."),
    ),
    "Serial lines": (
        (
            '`feed RX hex 02 41` · `feed RX text "abc\\r\\n"`',
            "Puts bytes on the simulated line of a ComBuffer, one piece for each line.",
        ),
        ("`feed RX break`", "Pulls the cable: the rest of a begun frame does not come."),
        (
            '`prefix RD hex 02` · `suffix RD text "\\r\\n"` · `suffix RD none`',
            "Sets the prefix or suffix of a ReceiveData or ReceiveString: its bytes and its length change in "
            "the same scan.",
        ),
        (
            "`framing RX` · `framing RD`",
            "Screen: ranks ways to cut the bytes of a ComBuffer into frames; key `B` shows the evidence.",
        ),
        ("`framing RD apply 1`", "Screen: sets the block to the first of these ways."),
    ),
    "Faults and the wire": (
        (
            "`fault bind EADDRINUSE on C1 times=1`",
            "Lets a kernel call fail. The effects are marked *injected*. `nth=3` lets the third call fail "
            "instead of the next one; `times=forever` lets all later calls fail, too.",
        ),
        ("`fault clear`", "Clears all faults."),
        (
            "`link C1 down` · `link C1 up`",
            "Silences the wire, without FIN or RST; ends the silence. With `--kernel live` it needs Linux, "
            "but no root: packets are dropped at the sockets. With `--netns` the interface goes down.",
        ),
    ),
    "A tap": (
        (
            "`tap T to-plc hold` · `tap T from-plc go`",
            "Holds the bytes of a direction; releases them. Once 1 MiB is held, the sender has to wait.",
        ),
        (
            "`tap T to-plc edit 3 hex 0A` · `tap T to-plc drop 4`",
            "Overwrites held bytes from position 3 on; drops the first four.",
        ),
        (
            "`tap T to-plc insert hex 01 02`",
            "Inserts bytes before the held ones. If `hold` is off, they go out at once.",
        ),
        ("`tap T to-plc delay T#50ms`", "Forwards each byte 50 ms later; `T#0s` ends the delay."),
        (
            "`tap T to-plc split 3,7`",
            "Forwards the next bytes as pieces of 3 and 7 bytes, with a pause of 50 ms after each.",
        ),
        (
            "`tap T to-plc fin` · `tap T to-plc rst`",
            "Sends FIN in this direction and nothing after it; sends RST to both ends.",
        ),
        (
            "`tap T to-plc hold conversation 2`",
            "Acts on conversation 2, not on the newest one. `conversation 2` may also come before the verb.",
        ),
    ),
    "Findings": (
        (
            "`doctor` · `doctor TRCV_C_1` · `doctor C1`",
            "Lists what the [doctor](doctor.md) finds in the run so far, with the surest finding first.",
        ),
        (
            "`doctor C1 frame-short` · `doctor TRCV_C_1 healthy`",
            "In a scenario: fails if another cause comes first.",
        ),
        (
            "`watch` · `watch C7`",
            "Screen of `watch -`: adds shadows for the newest conversation, or for C7.",
        ),
    ),
    "Time and triggers": (
        ("`hold` · `go`", "Screen: holds or resumes the scans."),
        (
            "`run 5` · `run T#200ms`",
            "Lets scans pass: 5 scans, or those of 200 ms. At the prompt, enter `hold` first.",
        ),
        (
            "`trigger TRCV_C_1 STATUS=80C5` · `trigger TRCV_C_1 EN_R rises` · `trigger rx.speed > 100`",
            "Screen: freezes the view in the scan in which the condition is met. `hold` at the end of the "
            "line holds the scans, too.",
        ),
        ("`trigger off`", "Screen: removes the trigger."),
        ("`find 7008`", "Screen: moves the timing and history panes to the next change to this STATUS."),
    ),
    "Files and panes": (
        (
            "`export timing vcd FILE`",
            "Screen: writes the waves that are drawn; if two markers are set, only those between them. "
            "Without FILE, the file goes into the project's folder.",
        ),
        (
            "`mark` · `save scenario FILE`",
            "Screen: sets a mark; saves the run as a scenario that expects what has happened since the mark.",
        ),
        (
            "`record` · `record FILE` · `record stop`",
            "Screen: records the run from its start (at most the newest 64 MiB); `record stop` ends the "
            "recording. "
            'Not possible with `black_box = "off"` in `[options]`.',
        ),
        ("`save recording FILE`", "Screen: saves the run up to now as a recording."),
        ("`scenarios` · `lab`", "Screen: opens the scenarios; opens the [UDT lab](udt.md)."),
        (
            "`udt open FILE` · `udt type NAME` · `udt ours baosky` · `udt theirs natural8 big`",
            "Lab: opens a type file; chooses a type; sets the profile of our side; of their side.",
        ),
        (
            "`udt swap` · `udt bytes last` · `udt hex 01 02` · `udt fit`",
            "Lab: exchanges the sides; chooses bytes; takes these bytes; ranks the profiles by the bytes.",
        ),
    ),
    "Expectations": (
        ("`wait TRCV_C_1 STATUS=7004 within T#2s`", "Scenario: lets scans pass until this is true."),
        (
            "`expect TRCV_C_1 STATUS=7008 RCVD_LEN=4` · `expect rx hex 01`",
            "Fails if this is not true now; with `within T#1s` (scenarios only), if it does not become true "
            "in that time.",
        ),
        (
            "`expect peer P1 closed` · `expect peer P1 received nothing`",
            "The same for a partner: its state; what it has received.",
        ),
        (
            "`expect TRCV_C_1 trace 0001 7001 7002+ 80A1! 7004 7006+`",
            "Scenario: compares the STATUS of each scan since the last `expect .. trace`. `+` means one scan "
            "or more, `!` means ERROR.",
        ),
    ),
}
NOT_SAVED: Final = (
    "`save project` saves constants, but not the effects of `create`, `delete`, `resize` and `set` of inputs."
)
TAP_NOTES: Final = """
Without a terminal, `trcvtui tap` reads these lines from stdin. Each act is marked as yours.

- A held direction holds its FIN or RST, too.
- Held datagrams are released one by one. A datagram that has no room is lost, and the tap reports it.
- A position is that of a held byte; the first is 0.
- When stdin or the screen ends, everything held is released.
- On the screen the keys `e` `i` `d` `y` `s` `r` `f` of pane 7 open the prompt with the line: enter sends it.
  `h` acts at once; with `--armed`, `r` and `f` do, too. The header shows `IN THE LINE`, and `HELD 12 s` since
  the oldest hold.
"""


def page() -> str:
    """Return the page."""
    assert missing() == [], missing()
    return HEAD + "".join(line + "\n" for line in _lines())


def examples() -> list[str]:
    """Return the example lines."""
    cells = [lines for rows in SECTIONS.values() for lines, _ in rows]
    return [line.strip("` ") for cell in cells for line in cell.split("` · `")]


def missing() -> list[str]:
    """Return what the program takes and no example shows."""
    lines = examples()
    of_peers = {line.split()[2] for line in lines if line.startswith("peer ")}
    lacking = [
        verb for verb in (*COMMANDS, *SCREEN_COMMANDS) if not any(line.startswith(verb) for line in lines)
    ]
    return [*lacking, *(f"peer P1 {verb}" for verb in PEER_VERBS if verb not in of_peers)]


def _lines() -> Iterator[str]:
    for title, rows in SECTIONS.items():
        yield from ("", f"## {title}", "", "| line | does |", "| --- | --- |")
        yield from (f"| {lines} | {does} |" for lines, does in rows)
        yield from {"A tap": TAP_NOTES.splitlines(), "The partner": _sent()}.get(title, ())
        if title == "The running program":
            yield from ("", NOT_SAVED)
        if title == "Parts of the project":
            yield from (
                "",
                "The forms of `A` and `E` send these lines. A STRUCT pasted into the form of a UDT file",
            )
            yield "becomes a file beside the project."
            yield from ("", "| kind | what it is |", "| --- | --- |")
            yield from (f"| `{kind}` | {TABLES[kind].help} |" for kind in OFFERED_KINDS)
        if title == "Faults and the wire":
            yield from ("", "The kernel calls, each with the error that it gives if the line names none:", "")
            yield ", ".join(f"`{call}` {error}" for call, error in DEFAULT_ERROR.items()) + "."


def _sent() -> Iterator[str]:
    yield from (
        "",
        "### What a peer sends",
        "",
        f"Forms: {_quoted(FORMS)}, and `message` of the library.",
        "",
    )
    yield f"Options after the bytes: {_quoted(f'{option}=' for option in TIMING)}. `split=3,7`"
    yield "cuts the message after 3 bytes and 7 bytes later, `gap=T#20ms` pauses between the pieces,"
    yield "`repeat=10` sends the message ten times, `every=T#50ms` sends one each 50 ms."
    yield from (
        "",
        f"Counters and checksums that are filled in: {_quoted(FILLS)}.",
        "`{n:2:big}` in hex, or `n=4:2:big` as an option, is a counter",
    )
    yield "of 2 bytes, here at offset 4. A checksum covers the bytes before it."


def _quoted(names: object) -> str:
    return ", ".join(f"`{name}`" for name in names)  # type: ignore[attr-defined]


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
