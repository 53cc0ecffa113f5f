"""Recorded runs that run again: to compare, print or view them."""
