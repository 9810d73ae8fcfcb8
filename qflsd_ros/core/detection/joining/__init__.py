"""One arc from several pieces."""
