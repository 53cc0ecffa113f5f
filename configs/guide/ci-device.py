"""A device of your own, as the guide's test in CI meets it: calls the PLC, reports each second, calls again after a loss."""

import socket
import struct
import sys
import time

PLC = ("127.0.0.1", int(sys.argv[1]))
REPORT = struct.pack(">ifBxfhBx", 1201, 500.5, 3, 21.5, 7, 1)  # as filling.udt lies in an S7

while True:
    try:
        with socket.create_connection(PLC) as line:
            while True:
                line.sendall(REPORT)
                time.sleep(1)
    except OSError:
        time.sleep(0.5)
