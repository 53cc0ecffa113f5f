"""What runs on a stream between the blocks and the kernel: ISO-on-TCP and TLS."""
