"""The blocks by themselves: the table of blocks, their jobs, framing."""
