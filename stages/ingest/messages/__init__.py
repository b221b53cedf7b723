"""Logs that are streams of messages: containers, decoders, and what becomes frames."""
