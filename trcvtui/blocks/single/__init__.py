"""Single instructions: a rising edge begins one job, which shows started, running, finished or failed."""
