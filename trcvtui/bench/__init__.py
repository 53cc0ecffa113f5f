"""One PLC with its peers, one kernel, one time; what goes along with its scans."""
