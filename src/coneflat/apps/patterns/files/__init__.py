"""Files: PDF, SVG and DXF."""
