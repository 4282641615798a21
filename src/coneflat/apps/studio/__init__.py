"""Flattening by hand and eye: what the user has chosen, a session that flattens by it, a server, a page."""
