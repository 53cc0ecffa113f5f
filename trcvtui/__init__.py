"""trcvtui: a soft PLC on a test bench, in a terminal.

The tour of the house, bottom to top; a folder imports only from folders below it.

* errors.py   what the user can mend, and where
* net/        how bytes travel: the kernel seam (kernel.py), the real and the simulated network behind it,
              faults in front of it, and one CONNECT at work (connection.py, set_up.py)
* udt/        what bytes mean: IEC types, layout, decode, encode
* blocks/     what the PLC programmer calls: TRCV_C, in neutral conditions, with its cause
* dialects/   which vendor's rules: STATUS words, switches, layout
* plc/        one scan: inputs, program, outputs, communication (runtime.py); commands, snapshot, ledger
* rig/        what stands around the PLC: the peer, the clock, the engine process, the scenario runner
* tui/        what is shown (the only floor that knows Textual)
* cli.py      the only door
"""

__version__ = "0.1.0"
