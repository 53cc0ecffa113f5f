"""Forms: what is added, changed, chosen, composed."""
