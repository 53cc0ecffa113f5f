"""A run as one page for a colleague: what it showed, why, and with which bytes."""
