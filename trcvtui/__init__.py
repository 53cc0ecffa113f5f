"""trcvtui: a soft PLC on a test bench, in a terminal.

The folders, bottom to top; each imports only from those below it (docs/architecture.md).

* records.py, errors.py  what `@dataclass` makes here; what the user can mend
* files.py, paths.py  the one reader and writer of files; where files lie
* net/        how bytes travel: the kernel seam (kernel.py), planned faults in front of it (faults.py)
    connection/  one CONNECT: described, built, used, lost; who owns a direction
    layers/      ISO-on-TCP and TLS on a stream
    os/  sim/    the real network of this machine; the simulated one
* udt/        what bytes mean: types, constants, names
    sources/ layout/ compare/ cure/ exports/
* blocks/     what the PLC programmer calls, in neutral conditions with their cause
    tcp/ udp/ serial/ single/
* dialects/   which vendor's rules: STATUS words, switches, layout: baosky/ siemens/ twincat/
* project/    a project file to a Project and back
* plc/        one scan: inputs, program, outputs, communication (runtime.py); ledger, snapshot
* capture/    evidence: capture files and their conversations; what a run asked, and a run on these answers
* rig/        what stands around the PLC
    commands/ peers/ bench/ history/ diagnosis/ framing_advice/ scenario/ engine/
* tui/        what is shown (the only folder that knows Textual)
    view_model/ panes/ forms/ widgets/ lab/ race/ scenarios/
* cli.py      the entry point
"""

__version__ = "0.2.0"
LANE = "TRCVTUI_LANE"  # of the environment; "slow": the PLC has no fast lanes (plc/fast_lane.py)


def lane_note() -> str:
    """Return ", slow lane" where the environment asks for it, else ""."""
    import os

    return ", slow lane" if os.environ.get(LANE) == "slow" else ""
