"""Words for what is written and shown, which commands list without loading what writes and shows."""

#: Formats that flattened meshes are written in: the endings of their files.
FORMATS = ("obj", "ply", "glb", "npz")

#: Triangles up to which the page draws a mesh as it is; larger ones, which the browser would turn haltingly, are
#: thinned to so many.
MOST_TRIANGLES = 500_000

#: What the viewer's page can show first.
SHOWS = ("checker", "picture", "charts", "qc", "area", "curvature", "flat", "plain")
