"""Declaration, parsing and validation of all options."""

from .combined import SEARCH_OPTIONS, Options
from .declared import (
    CONES,
    MAX_SHOWN_TRIANGLES,
    PAPER,
    RARE,
    SHOWS,
    AtlasOptions,
    ConeBounds,
    ConeNumber,
    ConeOptions,
    CurveOptions,
    Declaration,
    FindOptions,
    MetricOptions,
    RunOptions,
    SeamOptions,
    declarations,
    option,
)
from .kinds import (
    ANGLE,
    ANGLE_OR_NONE,
    COUNT,
    Choice,
    Direction,
    Edges,
    Flag,
    Kind,
    Number,
    Vertices,
    VerticesOrEdges,
    Weights,
    WordOrVertices,
    as_integer,
    as_number,
    strength,
)
from .reading import read_options, settings, takes
from .texts import (
    parse_angle,
    read_edges,
    read_numbers,
    read_vertices,
    read_vertices_or_pairs,
    read_word_or_vertex_map,
)

__all__ = [
    "ANGLE", "ANGLE_OR_NONE", "AtlasOptions", "CONES", "COUNT", "Choice", "ConeBounds", "ConeNumber", "ConeOptions",
    "CurveOptions", "Declaration", "Direction", "Edges", "FindOptions", "Flag", "Kind",
    "MAX_SHOWN_TRIANGLES", "MetricOptions", "Number", "Options", "PAPER", "RARE", "RunOptions", "SHOWS",
    "Vertices", "VerticesOrEdges", "Weights", "WordOrVertices", "as_number", "as_integer", "declarations", "option",
    "SEARCH_OPTIONS", "SeamOptions", "parse_angle", "read_edges", "read_numbers", "read_options", "read_vertices",
    "read_vertices_or_pairs", "read_word_or_vertex_map", "settings", "strength", "takes",
]  # fmt: skip
