"""Conversations of others, played to shadow instances on the simulated network."""
