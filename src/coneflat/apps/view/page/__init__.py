"""The interactive page of a flattening."""
