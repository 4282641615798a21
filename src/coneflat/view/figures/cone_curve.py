"""Drawing what how many cones gain."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...curve import ConeCurve

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CURVE_COLOR, WANTED_COLOR, KNEE_COLOR = "#35618f", "#b0413e", "#777777"


def draw_cone_curve(curve: ConeCurve, axes: Axes, *, distortion: float = 0.2) -> None:
    """Draw the area distortion against the number of cones, the distortion wanted, and the knee.

    Args:
        curve: what `coneflat.cone_curve` returns.
        axes: matplotlib axes to draw in.
        distortion: E that is wanted.
    """
    from matplotlib.ticker import MaxNLocator

    axes.plot(curve.counts, curve.distortions, color=CURVE_COLOR, marker="o", markersize=4, linewidth=1.5)
    axes.set_ylim(0.0, 1.1 * max(float(curve.distortions.max()), distortion))
    axes.axhline(distortion, color=WANTED_COLOR, linewidth=1.0, linestyle="--")
    axes.annotate(
        f"E = {distortion:g}",
        (curve.counts[-1], distortion),
        xytext=(0, 2),
        textcoords="offset points",
        color=WANTED_COLOR,
        ha="right",
        va="bottom",
    )
    axes.axvline(curve.knee, color=KNEE_COLOR, linewidth=0.8, linestyle=":")
    axes.annotate(
        f"knee: {curve.knee} cones",
        (curve.knee, axes.get_ylim()[1]),
        xytext=(3, 0),
        textcoords="offset points",
        color=KNEE_COLOR,
        ha="left",
        va="top",
    )
    axes.set_xlabel("number of cones")
    axes.set_ylabel("area distortion E (std. of the log scale)")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
