"""What comes in: meshes, what must hold for them, and what is asked of their vertices and edges."""
