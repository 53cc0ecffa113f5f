"""`trcvtui udt` on the command line."""
