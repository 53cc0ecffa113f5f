"""The simulated network: in-memory TCP and UDP on a virtual clock."""
