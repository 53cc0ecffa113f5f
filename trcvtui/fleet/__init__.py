"""Lines of many sites over an existing MQTT broker: topics, the connection, the agent, the reader."""
