"""How bytes travel: the kernel seam, the networks that answer it, and connections."""
