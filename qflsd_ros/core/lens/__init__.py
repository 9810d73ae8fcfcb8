"""The lens: its models, and their estimation from arcs."""
