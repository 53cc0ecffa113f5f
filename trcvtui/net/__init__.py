"""How bytes travel: the kernel seam, the networks that implement it, and connections."""
