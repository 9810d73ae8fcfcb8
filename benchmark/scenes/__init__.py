"""Rendered images whose edges are known exactly: plane scenes, a room, and their lenses."""
