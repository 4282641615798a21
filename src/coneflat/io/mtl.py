"""Material libraries of OBJ files (.mtl): the diffuse colour and image of each material."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..base.arrays import IntArray
from .obj import ObjText

#: Options of maps, with the largest number of their values. Of -o, -s and -t, all values but the first are optional.
_OPTIONS = {
    "-blendu": 1, "-blendv": 1, "-bm": 1, "-boost": 1, "-cc": 1, "-clamp": 1, "-imfchan": 1, "-mm": 2, "-o": 3,
    "-s": 3, "-t": 3, "-texres": 1, "-type": 1,
}  # fmt: skip
_VECTORS = ("-o", "-s", "-t")
#: Options that change colours, with the values that do not.
_NEUTRAL = {"-boost": (0.0,), "-mm": (0.0, 1.0), "-t": (0.0, 0.0, 0.0)}
#: Maps whose names do not begin with "map_".
_OTHER_MAPS = ("bump", "decal", "disp", "norm", "refl")


@dataclass(frozen=True)
class MtlMaterial:
    """A material of an MTL file.

    Attributes:
        colour: diffuse colour (Kd) as in the file, 0 to 1.
        opacity: 1 for opaque (d).
        image: name of the file that multiplies the colour (map_Kd), as in the library; None for none.
        offset, scale: of the image's UVs (-o, -s): the image at uv * scale + offset is shown, v upwards.
        is_clamped: the border of the image continues outside the unit square (-clamp); otherwise it repeats.
        left_out: statements and options on colours that are not read.
    """

    colour: tuple[float, float, float] = (1.0, 1.0, 1.0)
    opacity: float = 1.0
    image: str | None = None
    offset: tuple[float, float] = (0.0, 0.0)
    scale: tuple[float, float] = (1.0, 1.0)
    is_clamped: bool = False
    left_out: tuple[str, ...] = ()


def parse_mtl(content: bytes) -> dict[str, MtlMaterial]:
    """Return the materials of an MTL file by name; lines that cannot be read are left out."""
    materials: dict[str, MtlMaterial] = {}
    name: str | None = None
    for number, line in enumerate(content.removeprefix(b"\xef\xbb\xbf").splitlines(), 1):
        keyword, _, text = os.fsdecode(line).strip().replace("\t", " ").partition(" ")
        keyword, text = keyword.lower(), text.strip()
        if keyword == "newmtl":
            name = text
            materials[name] = MtlMaterial()
        elif name is not None and not keyword.startswith("#"):
            try:
                materials[name] = _with_line(materials[name], keyword, text)
            except ValueError as error:
                materials[name] = _without(materials[name], f"{keyword} in line {number} ({error})")
    return materials


def _with_line(material: MtlMaterial, keyword: str, text: str) -> MtlMaterial:
    """Return a material with another line of the file.

    Raises:
        ValueError: the line has text for a number.
    """
    if keyword == "map_kd":
        return _with_image(material, text)
    if keyword == "kd":
        if text.split()[:1] in (["spectral"], ["xyz"]):
            return _without(material, f"Kd {text.split()[0]}")
        numbers = [_number(word) for word in text.split()[:3]]
        if not numbers:
            raise ValueError("a number is missing")
        # One number is a grey.
        red, green, blue = (numbers * 3)[:3] if len(numbers) == 1 else (*numbers, 0.0)[:3]
        return replace(material, colour=(red, green, blue))
    if keyword == "d" and not text.startswith("-halo"):
        return replace(material, opacity=_number(text))
    # Programs disagree whether Tr 1 is transparent or opaque.
    is_light = keyword == "ke" and any(_number(word) > 0 for word in text.split()[:3])
    is_other_tr = keyword == "tr" and _number(text) != 0
    if is_light or is_other_tr or keyword in _OTHER_MAPS or keyword.startswith("map_"):
        return _without(material, keyword)
    return material


def _without(material: MtlMaterial, name: str) -> MtlMaterial:
    left_out = material.left_out if name in material.left_out else (*material.left_out, name)
    return replace(material, left_out=left_out)


def _with_image(material: MtlMaterial, text: str) -> MtlMaterial:
    """Return a material with the image of a `map_Kd` line, whose options precede the file name."""
    arguments: dict[str, tuple[str, ...]] = {}
    while (words := text.split(None, 1)) and words[0].lower() in _OPTIONS:
        option, text = words[0].lower(), words[1] if len(words) > 1 else ""
        values: list[str] = []
        while len(values) < _OPTIONS[option] and (words := text.split(None, 1)):
            if option in _VECTORS and values and not _is_number(words[0]):
                break
            values.append(words[0])
            text = words[1] if len(words) > 1 else ""
        arguments[option] = tuple(values)
    if not text:
        raise ValueError("there is no file name")
    left_out = [f"{option} of map_Kd" for option in arguments if _changes_colours(option, arguments[option])]
    for name in left_out:
        material = _without(material, name)
    return replace(
        material,
        image=text.strip('"'),
        offset=_pair(arguments.get("-o", ()), 0.0),
        scale=_pair(arguments.get("-s", ()), 1.0),
        is_clamped=arguments.get("-clamp", ("off",))[0].lower() == "on",
    )


def _changes_colours(option: str, values: tuple[str, ...]) -> bool:
    if option == "-cc":
        return values[0].lower() == "on"
    neutral = _NEUTRAL.get(option)
    return neutral is not None and any(
        _number(word) != number for word, number in zip(values, neutral, strict=False)
    )


def _pair(words: tuple[str, ...], default: float) -> tuple[float, float]:
    first, second = [*(_number(word) for word in words[:2]), default, default][:2]
    return first, second


def _number(word: str) -> float:
    value = float(word)
    if not math.isfinite(value):
        raise ValueError(f"{word} is not a finite number")
    return value


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def materials_of_polygons(text: ObjText, count: int) -> tuple[list[str], IntArray]:
    """Return the names of the materials that an OBJ file uses, and (p,) the material of each polygon, -1 for none.

    count: number of polygons.
    """
    numbers: dict[str, int] = {}
    starts, materials = [0], [-1]
    for polygon in sorted(text.gaps):
        for name in _statements(text.gaps[polygon], b"usemtl"):
            starts.append(polygon)
            materials.append(numbers.setdefault(name, len(numbers)))
    return list(numbers), np.repeat(materials, np.diff([*starts, count]))


def libraries_of(text: ObjText, folder: Path) -> list[Path]:
    """Return the paths of the material libraries of an OBJ file in a folder."""
    paths: list[Path] = []
    for polygon in sorted(text.gaps):
        for names in _statements(text.gaps[polygon], b"mtllib"):
            # A line may have several names, or one name with blanks; it is one name if such a file exists.
            is_single = (folder / names).exists()
            paths += [folder / name for name in ([names] if is_single else names.split())]
    return list(dict.fromkeys(paths))


def _statements(text: bytes, keyword: bytes) -> Iterator[str]:
    """Yield what follows a keyword in the lines of a text that begin with it."""
    if keyword not in text:
        return
    for line in text.splitlines():
        words = line.strip().split(None, 1)
        if words[:1] == [keyword]:
            yield os.fsdecode(words[1] if len(words) > 1 else b"").strip()


def path_of_image(name: str, folder: Path) -> Path:
    """Return the path of an image of a library in a folder; Windows writes paths with backslashes."""
    path = folder / name
    return path if path.exists() or "\\" not in name else folder / name.replace("\\", "/")
