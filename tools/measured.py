"""Measures of models, for the numbers and pictures of the documentation.

The marker of a number contains its definition: `<!-- n bunny charts=one qc_mean .3f -->` is a model, options of
`coneflat.flatten` if any, or `by=` another method, a key of the report, and a number format.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from markers import ROOT

import coneflat

sys.path.insert(0, str(ROOT / "tests"))
sys.path.insert(0, str(ROOT / "benchmarks"))
import shapes
from common import parse_options
from comparisons import Comparison, compare_methods, flatten_by

Report = dict[str, Any]


class Measured:
    """Reports of models, which are cached."""

    def __init__(self, models: Path) -> None:
        """Find the models in a folder; the sample and a bumpy sphere always exist."""
        self._folder = models
        self._reports: dict[str, Report | None] = {}
        self._defaults: dict[str, coneflat.Flattening] = {}
        self._comparisons: dict[tuple[str, tuple[str, ...], str], Comparison] = {}
        self._missing: set[str] = set()

    def path(self, model: str) -> Path | None:
        """Return the path of a model; None, with one message, if it is missing."""
        if model == "sample":
            return coneflat.sample_path()
        paths = sorted(self._folder.glob(f"{model}.*"))
        if not paths and model not in self._missing:
            self._missing.add(model)
            print(f"{model} is not in {self._folder}: what is said of it is left as it is", flush=True)
        return paths[0] if paths else None

    def has(self, *models: str) -> bool:
        """Return whether all given models exist."""
        return None not in [self.path(model) for model in models]

    def flattening(self, model: str) -> coneflat.Flattening:
        """Return a model flattened with all defaults, which pictures and numbers share."""
        if model not in self._defaults:
            print(f"  {model}", flush=True)
            self._defaults[model] = coneflat.flatten(self.path(model))
        return self._defaults[model]

    def report(self, model: str, **options: Any) -> Report | None:
        """Return the report of a flattening; None if the model is missing."""
        key = f"{model} {sorted(options.items(), key=str)}"
        if key not in self._reports:
            if model == "sphere":
                result = coneflat.flatten(*shapes.sphere(5), **options)
            elif self.path(model) is None:
                return None
            elif "by" in options:
                print(f"  {model} {options}", flush=True)
                chosen = dict(options)
                result = flatten_by(chosen.pop("by"), self.path(model), **chosen)
            elif not options:
                result = self.flattening(model)
            else:
                print(f"  {model} {options}", flush=True)
                result = coneflat.flatten(self.path(model), **options)
            self._reports[key] = result.report()
        return self._reports[key]

    def comparison(self, model: str, methods: tuple[str, ...], **options: Any) -> Comparison:
        """Return the comparison of several methods on a model with the same cones and cut."""
        key = (model, methods, str(options))
        if key not in self._comparisons:
            print(f"  {model} by {len(methods)} methods", flush=True)
            self._comparisons[key] = compare_methods(self.path(model), methods=methods, atlases=(), **options)
        return self._comparisons[key]


def number_text(measured: Measured, definition: str, present: str) -> str:
    """Return what a number is now: by its name, and as it stands there."""
    model, *words = definition.split()
    form = words.pop() if words[-1][0] in ".," else ","
    options = parse_options(word for word in words if "=" in word)
    (key,) = (word for word in words if "=" not in word)
    report = measured.report(model, **options)
    return present if report is None else format(report[key], form)
