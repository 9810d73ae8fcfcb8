"""From arcs to messages."""
