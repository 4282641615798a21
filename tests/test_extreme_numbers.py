"""Extreme numbers for any option of any function lead to a finite result or to one of our errors."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import shapes

import coneflat
from coneflat import errors
from coneflat.options import Number, Options, declarations
from coneflat.options.declared import CurveOptions, FindOptions
from coneflat.quadmesh.options import QuadOptions
from coneflat.textures.options import ChartNumber, UnwrapOptions

EXTREMES = (1e-300, 1e-162, 1e155, 1e308, np.nan, np.inf, -np.inf, -1, 0)
HILL = shapes.hill(5, 4)
#: The functions on a small mesh, the declarations of their options, and what must be finite of a result.
FUNCTIONS = {
    "flatten": (Options, lambda **options: coneflat.flatten(*HILL, **options).uv),
    "unwrap": (UnwrapOptions, lambda **options: coneflat.unwrap(*HILL, **options).uv),
    "quads": (QuadOptions, lambda **options: coneflat.quads(*HILL, **{"quads": 50, **options}).vertices),
    "find_cones": (FindOptions, lambda **options: coneflat.find_cones(*HILL, **options).curvatures),
    "cone_curve": (CurveOptions, lambda **options: coneflat.cone_curve(*HILL, **options).distortions),
}
NUMBERS = [
    (function, name)
    for function, (group, _) in FUNCTIONS.items()
    for name, declared in declarations(group).items()
    if isinstance(declared.kind, (Number, ChartNumber))
]


def outcome(call, **options):
    """Return the message of one of our errors, or "" for a finite result; warnings of NumPy fail."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        try:
            values, text = call(**options), ""
        except errors.ConeflatError as error:
            values, text = np.empty(0), str(error) or "empty"
    assert np.isfinite(values).all()
    assert len(text) < 600
    return text


def with_size(function, name, value):
    """Return options of a call; a size replaces the number of quads."""
    return {name: value, **({"quads": None} if (function, name) == ("quads", "size") else {})}


@pytest.mark.slow
@pytest.mark.parametrize(("function", "name"), NUMBERS)
def test_an_extreme_number_leads_to_a_finite_result_or_to_one_of_our_errors(function, name):
    for value in EXTREMES:
        outcome(FUNCTIONS[function][1], **with_size(function, name, value))


@pytest.mark.parametrize(("function", "name"), NUMBERS)
def test_values_that_are_not_numbers_are_refused_by_name(function, name):
    noun = name.replace("_", " ").removeprefix("min ").removeprefix("max ")
    text = outcome(FUNCTIONS[function][1], **with_size(function, name, np.nan))
    assert name in text or noun in text


@pytest.mark.parametrize("area", [1e-300, 1e-162, 1e155, 1e308, np.inf, 0, -1])
def test_an_area_distortion_that_no_map_has_is_refused_with_its_range(area):
    with pytest.raises(errors.OptionError, match="area must be a number from 1e-06 to 100, got"):
        coneflat.unwrap(*HILL, area=area)


@pytest.mark.parametrize("area", [1e-6, 100.0])
def test_the_ends_of_the_range_of_area_distortions_are_valid(area):
    assert not outcome(FUNCTIONS["unwrap"][1], area=area)


@pytest.mark.slow
def test_extreme_numbers_for_a_cortex(tmp_path):
    nibabel = pytest.importorskip("nibabel")
    from coneflat.apps.brains import flatten_cortex
    from coneflat.apps.cli.brain_command import BrainOptions

    nibabel.freesurfer.write_geometry(tmp_path / "lh.pial", *shapes.sphere(2))
    names = [
        name
        for name, declaration in declarations(BrainOptions).items()
        if isinstance(declaration.kind, Number)
    ]
    for name in names:
        for value in EXTREMES:
            outcome(lambda **options: flatten_cortex(tmp_path / "lh.pial", **options).points, **{name: value})


@pytest.mark.parametrize("resolution", EXTREMES)
def test_extreme_resolutions_of_a_transfer(tmp_path, resolution):
    pytest.importorskip("PIL.Image")
    from coneflat.apps.transfer import transfer

    model = coneflat.flatten(*HILL).save(tmp_path / "model.ply")
    text = outcome(lambda: transfer(model, model, resolution=resolution).images["baseColorTexture"])
    assert "resolution must be an integer" in text
