"""The blocks that a PLC programmer calls. They show neutral conditions; a dialect adds STATUS words."""
