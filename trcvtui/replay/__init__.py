"""A recorded run again: to compare it, to print it, to look at it."""
