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

- A line that is not understood changes nothing. The answer says where, what was found and what was expected.
- The names are those of a project: TRCV_C_1 is an instance, C1 a CONNECT, rx a DATA, P1 a peer,
  RX a ComBuffer, T a tap.
- "Screen" in a row: only the prompt takes it. "Scenario": only a scenario takes it. `start` takes
  what lets no scan pass.

`make atlas` writes this page.
"""
SECTIONS: Final[dict[str, Sequence[Row]]] = {
    "Inputs and DATA": (
        ("`set TRCV_C_1 CONT=1 EN_R=1 LEN=4`", "Writes inputs. `REQ=blink` toggles the input in each scan."),
        ("`pulse TRCV_C_1 COM_RST`", "Sets an input to TRUE for one scan."),
        ("`write rx hex 01 02` · `write report.weight 2.5`", "Writes bytes, or one member, into DATA."),
        ("`plc stop` · `plc run`", "Takes the CPU to STOP and back to RUN."),
    ),
    "The running program": (
        (
            "`create TSEND_C S2 connect=C1 data=tx`",
            "Makes an instance in the running program.",
        ),
        ("`delete S2`", "Deletes an instance from the running program."),
        ("`download S2`", "Downloads an instance anew, as after a changed initial value; its inputs stay."),
        ("`resize tx STRING[20]`", "Gives a DATA another type."),
        (
            "`udt reload`",
            "Screen: reads the UDT files again, with those whose `[[udt]]` you have added to the file.",
        ),
        ("`udt constant GVL.MAX=10`", "Screen: sets a constant of the types; `save project` keeps it."),
    ),
    "Parts of the project": (
        (
            "`add connect C3 LocalPort=2001`",
            "Adds a part. The keys are those of [its file](project-file.md).",
        ),
        ('`add connect C4 type=TCON_IP_RFC LocalTSelector="16#E002"`', "Siemens: a description by fields."),
        ('`add connect C5 bytes="00 40 00 01 ..."`', "Siemens: a description as the bytes of its DB."),
        ("`add data rx2 ARRAY[0..9] OF BYTE`", "Adds a DATA with its type."),
        (
            "`add instance R2 block=TRCV_C connect=C3 data=rx2 CONT=1`",
            "Chooses a CONNECT (UDP_CONFIG and ADDR, ComBuffer) that the line leaves out, and DATA with it. "
            "`data=new` or `connect=new` makes one.",
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
        ("`add peer P3 remote=@C3`", "Adds a partner that connects to where C3 listens."),
        ("`add certificate 3 file=plc.pem key=plc.key`", "Adds a certificate under a number."),
        (
            "`add peer P4 remote=@C4 tls=true certificate=3 authority=3`",
            "Adds a partner that speaks TLS.",
        ),
        ('`add message hi text "hi" split=1` · `add sequence s hi T#1s hi`', "Adds to the message library."),
        (
            "`add udt types/order.st`",
            "Adds a type file and answers its types, their sizes and the sender's layout. The rest of the "
            "line is its name, without quotes; a file is added once.",
        ),
        (
            "`set C2 LocalPort=2500` · `set rx ARRAY[0..99] OF BYTE` · `set P1 reconnect=T#1s`",
            "Sets keys of a part; `KEY=` removes a key. Inputs stay. Prompt and answer say what starts anew.",
        ),
        (
            '`set connect C2 LocalPort=2500` · `set message hi text "ho"` · `set instance TRCV_C_1 data=rx`',
            "The same with the kind of the part; needed where two parts have the name.",
        ),
        (
            "`remove C2` · `remove connect C2`",
            "Removes a part; refused, with their names, while others use it.",
        ),
        (
            "`undo`",
            "Takes back the newest `add`, `set` of a part or `remove`, up to 20. Inputs and traffic stay.",
        ),
        (
            "`save project`",
            "Screen: writes what `add`, `set` of a part, `remove` and `udt constant` did into the file. "
            "Comments and order stay; missing type files are written again.",
        ),
        (
            "`save project FILE` · `save project FILE !`",
            "Screen: writes the bench, with the comments of its own file, into another one. `!` overwrites a "
            "file, also the own one that is gone, broken or another project.",
        ),
    ),
    "The partner": (
        ("`peer P1 connect` · `peer P2 listen`", "Makes one attempt to connect; opens the listener."),
        ("`peer P1 close` · `peer P1 rst`", "Closes with FIN; closes with RST."),
        ("`peer P1 shutdown`", "Half-close: sends FIN and still receives."),
        ("`peer P1 stall` · `peer P1 resume`", "Stops reading, so that the window closes; reads again."),
        (
            '`peer P1 send hex 01 02` · `peer P1 send text "abc"` · `peer P1 send random 100 seed=1`',
            "Sends bytes. Forms and options are [below](#what-a-peer-sends).",
        ),
        ("`peer P1 send udt Weight {state=1}` · `peer P1 send file x.bin`", "Sends a UDT, or a file."),
        ("`peer P1 send udt STRUCT a : INT; END_STRUCT {a=1}`", "Sends a type that is declared in the line."),
        ("`peer P1 send message hello`", "Sends a named message of the project."),
        ("`peer P1 play start`", "Plays a sequence of messages and pauses over one connection."),
        (
            "`peer P1 reply on contains hex 05 send hex 06`",
            "Answers by itself, by `contains`, `starts` or a field of a UDT. `{n}` in the answer counts, and "
            "checksums are filled in.",
        ),
        ("`peer P1 reply off`", "Removes all rules; with a number that one."),
        (
            "`peer P1 try-splits hex 01 02 03 on TRCV_C_1`",
            "Sends the message whole, then cut at each place, and lists each result. `gap=T#30ms` is the "
            "pause; in a scenario `differ=0` is how many may differ.",
        ),
        ("`peer P1 try-splits stop`", "Ends that."),
        (
            "`peer P1 check on size=64 every=T#100ms on TRCV_C_1`",
            "Sends frames with a number and a CRC. DATA and what comes back are checked: lost, doubled, "
            "shifted.",
        ),
        ("`peer P1 check off`", "Ends that."),
    ),
    "Serial lines": (
        (
            '`feed RX hex 02 41` · `feed RX text "abc\\r\\n"`',
            "Puts bytes on the simulated line of a ComBuffer, in the pieces in which they are fed.",
        ),
        ("`feed RX break`", "Pulls the cable: the rest of a half frame does not come."),
        (
            '`prefix RD hex 02` · `suffix RD text "\\r\\n"` · `suffix RD none`',
            "Sets the marks of a ReceiveData or ReceiveString: the bytes in their variable and the length, "
            "in one scan.",
        ),
        (
            "`framing RX` · `framing RD`",
            "Screen: ranks ways to cut the bytes of a ComBuffer into frames; key `B` shows the evidence.",
        ),
        ("`framing RD apply 1`", "Screen: sets the block to the first of them."),
    ),
    "Faults and the wire": (
        (
            "`fault bind EADDRINUSE on C1 times=1`",
            "Lets a kernel call fail. What follows is marked *injected*. `nth=3` waits for the third call, "
            "`times=forever` repeats it.",
        ),
        ("`fault clear`", "Clears all faults."),
        (
            "`link C1 down` · `link C1 up`",
            "Silences the wire, without FIN or RST. Live it needs Linux, but no root: packets are dropped at "
            "the sockets. With `--netns` the interface goes down.",
        ),
    ),
    "A tap": (
        (
            "`tap T to-plc hold` · `tap T from-plc go`",
            "Holds the bytes of a direction, and releases them. Beyond 1 MiB the sender waits.",
        ),
        (
            "`tap T to-plc edit 3 hex 0A` · `tap T to-plc drop 4`",
            "Changes held bytes from 3 on; drops four.",
        ),
        ("`tap T to-plc insert hex 01 02`", "Inserts bytes; if nothing is held, they go out at once."),
        ("`tap T to-plc delay T#50ms`", "Forwards each byte later; `T#0s` ends it."),
        ("`tap T to-plc split 3,7`", "Forwards the next bytes in pieces, with 50 ms between them."),
        (
            "`tap T to-plc fin` · `tap T to-plc rst`",
            "Sends FIN this way and nothing more; RST to both ends.",
        ),
        (
            "`tap T to-plc hold conversation 2`",
            "Acts on that conversation, not on the newest one. The two words may also come before the verb.",
        ),
    ),
    "Findings": (
        (
            "`doctor` · `doctor TRCV_C_1` · `doctor C1`",
            "Lists what the [doctor](doctor.md) finds in the run so far, the surest first.",
        ),
        (
            "`doctor C1 frame-short` · `doctor TRCV_C_1 healthy`",
            "In a scenario: fails if another cause comes first.",
        ),
        (
            "`watch` · `watch C7`",
            "Screen of `watch -`: gives the newest conversation, or C7, its own shadows.",
        ),
    ),
    "Time and triggers": (
        ("`hold` · `go`", "Screen: holds or resumes the scans."),
        (
            "`run 5` · `run T#200ms`",
            "Lets that many scans, or scans for that time, pass; at the prompt after `hold`.",
        ),
        (
            "`trigger TRCV_C_1 STATUS=80C5` · `trigger TRCV_C_1 EN_R rises` · `trigger rx.speed > 100`",
            "Screen: freezes the view in the scan in which it fires. `hold` at the end holds the scans, too.",
        ),
        ("`trigger off`", "Screen: removes the trigger."),
        ("`find 7008`", "Screen: the timing and history panes go to the next edge to this STATUS."),
    ),
    "Files and panes": (
        (
            "`export timing vcd FILE`",
            "Screen: writes the waves that are drawn, between the markers if there are two. Without FILE: "
            "into the project's folder.",
        ),
        (
            "`mark` · `save scenario FILE`",
            "Screen: saves what was done, and expects what came since the mark.",
        ),
        (
            "`record` · `record FILE` · `record stop`",
            "Screen: records the run from its beginning, at most its newest 64 MiB, and ends that. Not with "
            '`black_box = "off"` in `[options]`.',
        ),
        ("`save recording FILE`", "Screen: saves the run up to now as a recording."),
        ("`scenarios` · `lab`", "Screen: opens the scenarios; opens the [UDT lab](udt.md)."),
        (
            "`udt open FILE` · `udt type NAME` · `udt ours baosky` · `udt theirs natural8 big`",
            "Lab: opens a type file, takes a type, sets the profile of either side.",
        ),
        (
            "`udt swap` · `udt bytes last` · `udt hex 01 02` · `udt fit`",
            "Lab: exchanges the sides, takes bytes, ranks the profiles by them.",
        ),
    ),
    "Expectations": (
        ("`wait TRCV_C_1 STATUS=7004 within T#2s`", "Scenario: lets scans pass until it holds."),
        (
            "`expect TRCV_C_1 STATUS=7008 RCVD_LEN=4` · `expect rx hex 01`",
            "Fails if it does not hold now; with `within T#1s` (scenarios only), if not in that time.",
        ),
        (
            "`expect peer P1 closed` · `expect peer P1 received nothing`",
            "The same of a partner: its state, and what it received.",
        ),
        (
            "`expect TRCV_C_1 trace 0001 7001 7002+ 80A1! 7004 7006+`",
            "Scenario: compares the STATUS of each scan since the last `trace`. `+`: one scan or more, "
            "`!`: ERROR.",
        ),
    ),
}
NOT_SAVED: Final = (
    "`save project` saves the constants, but not `create`, `delete`, `resize` and `set` of inputs."
)
TAP_NOTES: Final = """
`trcvtui tap` reads these lines from stdin without a terminal, and they mark each act as yours.

- A held direction holds its FIN or RST, too.
- Held datagrams go on one by one. What has no room is lost, and the tap says so.
- Positions are those of held bytes, from 0.
- Nothing stays held when stdin, or the screen, ends.
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
            yield from ("", "The calls, and the error of each if the line names none:", "")
            yield ", ".join(f"`{call}` {error}" for call, error in DEFAULT_ERROR.items()) + "."


def _sent() -> Iterator[str]:
    yield from (
        "",
        "### What a peer sends",
        "",
        f"Forms: {_quoted(FORMS)}, and `message` of the library.",
        "",
    )
    yield f"Options after it: {_quoted(f'{option}=' for option in TIMING)}. `split=3,7` cuts it after 3 and 7"
    yield "bytes more, `gap=T#20ms` pauses between the pieces, `repeat=10` sends it ten times, one each"
    yield "`every=T#50ms`."
    yield from (
        "",
        f"Filled in: {_quoted(FILLS)}.",
        "`{n:2:big}` in hex, or `n=4:2:big` as an option, is a counter",
    )
    yield "of 2 bytes, here at offset 4. A checksum covers what precedes it."


def _quoted(names: object) -> str:
    return ", ".join(f"`{name}`" for name in names)  # type: ignore[attr-defined]


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
