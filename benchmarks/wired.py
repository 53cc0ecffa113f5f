"""A project whose CONNECTs dial the partners of `traffic`: some of its many instances receive."""

from __future__ import annotations

from collections.abc import Sequence


def project(interval: str, ports: Sequence[int], instances: int, receiving: int, message: int) -> str:
    """Return the file; the instances share the CONNECTs in turn, the first `receiving` have EN_R."""
    parts = ['dialect = "baosky"', 'model = "T4"']
    if message > 65535:
        parts.append(f"[options]\nmax_len = {message}")
    parts.append(f'[[task]]\nname = "MAIN"\ninterval = "{interval}"')
    for number, port in enumerate(ports):
        parts.append(
            f'[[connect]]\nname = "C{number}"\nActiveEstablished = true\nLocalAddress = "127.0.0.1"\n'
            f'RemoteAddress = "127.0.0.1"\nRemotePort = {port}'
        )
    for number in range(instances):
        receives = "true" if number < receiving else "false"
        parts.append(
            f'[[data]]\nname = "rx{number}"\ntype = "ARRAY[1..{message}] OF BYTE"\n'
            f'[[instance]]\nname = "TRCV_C_{number}"\nblock = "TRCV_C"\nconnect = "C{number % len(ports)}"\n'
            f'data = "rx{number}"\nCONT = true\nEN_R = {receives}'
        )
    return "\n\n".join(parts) + "\n"
