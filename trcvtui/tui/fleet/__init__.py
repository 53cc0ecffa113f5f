"""The screen of `trcvtui fleet`: all lines of all sites, and one of them in full."""
