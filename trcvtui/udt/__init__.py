"""What the bytes mean: UDT types, their layout in DATA, decode, encode, and the source formats."""
