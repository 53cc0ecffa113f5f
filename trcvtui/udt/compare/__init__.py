"""Two layouts side by side, and which layout fits the bytes that came."""
