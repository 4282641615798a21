"""DXF: a drawing on one sheet, in millimetres, by layers."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from ....io import atomic_write, imported
from ..drawing.drawing import LAYERS, Drawing, Line, Text
from .pens import PENS

#: The version of the format: AutoCAD 2000, the first with the line weights and polylines that are written.
VERSION = "R2000"
#: The unit of coordinates in the header, $INSUNITS: millimetres.
MILLIMETRES = 4


def write_dxf(drawing: Drawing, path: Path) -> None:
    """Write a drawing.

    Raises:
        OptionError: ezdxf is not installed.
        MeshFileError: the file cannot be written.
    """
    document, stream = dxf_of(drawing), StringIO()
    with _without_times():
        document.write(stream)
    with atomic_write(path, "wb") as file:
        file.write(document.encode(stream.getvalue()))


def dxf_of(drawing: Drawing) -> Any:
    """Return a drawing as a document of ezdxf; the same for the same drawing: without times and random numbers.

    Raises:
        OptionError: ezdxf is not installed.
    """
    ezdxf = imported("ezdxf", "DXF files need ezdxf", '"coneflat[patterns]"')
    with _without_times():
        document = ezdxf.new(VERSION, units=MILLIMETRES)
    document.header["$MEASUREMENT"] = 1
    for layer in LAYERS:
        document.layers.add(layer, color=PENS[layer].index, lineweight=round(100 * PENS[layer].width))
    names: dict[tuple[float, ...], str] = {}
    space = document.modelspace()
    for line in drawing.lines:
        _add_line(document, space, line, names)
    for text in drawing.texts:
        _add_text(space, text)
    # When the document is written, the header gets the values of the space, but not those of the origin.
    document.header["$EXTMIN"], document.header["$EXTMAX"] = (
        (0.0, 0.0, 0.0),
        (drawing.width, drawing.height, 0.0),
    )
    space.reset_extents((0.0, 0.0, 0.0), (drawing.width, drawing.height, 0.0))
    space.reset_limits((0.0, 0.0), (drawing.width, drawing.height))
    document.set_modelspace_vport(height=drawing.height, center=(drawing.width / 2, drawing.height / 2))
    return document


@contextmanager
def _without_times() -> Iterator[None]:
    """Let ezdxf write no times and random numbers."""
    from ezdxf import options

    before = options.write_fixed_meta_data_for_testing
    options.write_fixed_meta_data_for_testing = True
    try:
        yield
    finally:
        options.write_fixed_meta_data_for_testing = before


def _add_line(document: Any, space: Any, line: Line, names: dict[tuple[float, ...], str]) -> None:
    look = {"layer": line.layer}
    if line.dashes:
        if line.dashes not in names:
            names[line.dashes] = f"DASHES{len(names) + 1}"
            signs = [1.0, -1.0] * (len(line.dashes) // 2)
            pattern = [sum(line.dashes), *np.multiply(line.dashes, signs).tolist()]
            document.linetypes.add(names[line.dashes], pattern)
        look["linetype"] = names[line.dashes]
    polyline = space.add_lwpolyline(line.points.tolist(), close=line.is_closed, dxfattribs=look)
    polyline.dxf.flags |= 128  # Dashes go on around corners, not anew at each point.


def _add_text(space: Any, text: Text) -> None:
    from ezdxf.enums import TextEntityAlignment

    look = {"layer": text.layer, "rotation": float(np.degrees(text.angle))}
    entity = space.add_text(text.text, height=text.size, dxfattribs=look)
    align = TextEntityAlignment.MIDDLE_LEFT if text.is_left else TextEntityAlignment.MIDDLE_CENTER
    entity.set_placement(np.asarray(text.place).tolist(), align=align)
