"""Sheets: one piece, with bend lines."""
