"""A run as one page for a colleague: what the run showed, why, and with which bytes."""
