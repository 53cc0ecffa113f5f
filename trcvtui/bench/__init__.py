"""One PLC and its peers on one kernel and one clock; also the program, the trials and the doctor."""
