"""The protocol between engine and screen: command lines, requests, and pictures of the bench."""
