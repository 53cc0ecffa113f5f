"""A tap: the process that forwards, who looks on, and the recording of what passes."""
