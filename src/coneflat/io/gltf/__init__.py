"""glTF 2.0: reading of scenes, and writing of scenes with new texture coordinates."""
