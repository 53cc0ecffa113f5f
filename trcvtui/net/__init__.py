"""How bytes travel: the kernel seam, what stands behind it, and connections."""
