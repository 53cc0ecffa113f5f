"""Single instructions: an edge of REQ, or EN_R = 1, begins a job: started, running, finished or failed."""
