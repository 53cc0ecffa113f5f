"""The blocks on TCP connections, and the jobs and parts that they share."""
