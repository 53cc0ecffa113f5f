"""Lines of many sites over a broker that is there already: topics, the way to it, the agent."""
