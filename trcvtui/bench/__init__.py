"""A test bench: a PLC and its peers, on one kernel and one clock, with a program, trials and a doctor."""
