"""What the PLC programmer calls: the blocks, in neutral conditions; a dialect gives them STATUS words."""
