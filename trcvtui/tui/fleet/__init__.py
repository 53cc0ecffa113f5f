"""The screen of `trcvtui fleet`: all lines of all sites, and the card of one line."""
