"""The dialect race on the screen."""
