"""Words for what is written and shown, which commands list without loading what writes and shows."""

#: Formats that flattened meshes are written in: the endings of their files.
FORMATS = ("obj", "ply", "glb", "npz")

#: What the viewer's page can show first.
SHOWS = ("checker", "picture", "charts", "qc", "area", "curvature", "flat", "plain")
