"""What passes between the stages: what goes in (`inputs`) and what comes out (`outputs`)."""

from .inputs import ConeSpec, MetricSpec, RelaxSpec, SeamSpec, Surface, VertexCurvatures
from .outputs import ConeSolution, Cut, Embedding, FlatMetric, LaplacianInverse, Layout, SolveStatistics

__all__ = [
    "ConeSolution",
    "ConeSpec",
    "Cut",
    "Embedding",
    "FlatMetric",
    "LaplacianInverse",
    "Layout",
    "MetricSpec",
    "RelaxSpec",
    "SeamSpec",
    "SolveStatistics",
    "Surface",
    "VertexCurvatures",
]
