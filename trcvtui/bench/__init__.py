"""One PLC and its peers on one kernel and one clock, and what runs along with the scans."""
