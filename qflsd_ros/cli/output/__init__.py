"""The files that the commands write."""
