"""The blocks that a PLC programmer calls. Blocks show conditions; a dialect turns each into its STATUS."""
