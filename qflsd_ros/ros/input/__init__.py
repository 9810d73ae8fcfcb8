"""From image messages to grey frames."""
