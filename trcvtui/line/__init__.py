"""Conversations of other programs, played to shadow instances on the simulated network."""
