"""What the product reaches of its performance targets (design section 7), measured as paired ratios."""
