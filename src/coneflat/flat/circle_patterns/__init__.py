"""Circle patterns: the flat metric of circles that meet at given angles."""
