"""One scan: inputs, program, outputs, communication."""
