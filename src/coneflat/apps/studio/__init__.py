"""Interactive flattening in the browser: the choices of the user, a session that flattens, a server, a page."""
