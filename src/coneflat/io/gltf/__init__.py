"""glTF 2.0: reading scenes, and writing them with new texture coordinates."""
