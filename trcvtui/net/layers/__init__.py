"""Protocols between the blocks and the kernel, on a TCP stream: ISO-on-TCP and TLS."""
