"""Forms of the screen: add and change parts of a project, choose messages, fill in a UDT."""
