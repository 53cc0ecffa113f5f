"""Frames out of a stream of bytes: prefix, suffix, block size, gap (receivedata.md 3-5); knows no block."""
