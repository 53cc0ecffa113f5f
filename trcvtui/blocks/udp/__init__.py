"""The blocks on UDP sockets."""
