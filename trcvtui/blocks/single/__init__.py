"""Single instructions, one job a rising edge: started, running, finished or failed."""
