"""The commands' flags, made from the declarations of the options, and values as they are written for them."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

import click
from click.core import ParameterSource

from ... import PAPER
from ... import options as declared
from ...errors import MeshFileError, OptionError
from ...options import ConeOptions, Declaration, Kind, MetricOptions, Number, Options, declarations, option
from .shared import Grouped, checking

if TYPE_CHECKING:
    from ...base import FloatArray, IntArray

Command = TypeVar("Command", bound=Callable[..., Any])
G = TypeVar("G")

#: Options that `shared.input_options` adds.
OF_INPUT = ("repair", "strict")
#: Other spellings of flags.
SPELLINGS = {"quantise": ("--quantize",), "quads": ("--faces",), "output": ("-o",)}

paper_option = click.option(
    "--paper",
    cls=Grouped,
    group="Metric",
    is_flag=True,
    help="The method exactly as published (Ben-Chen et al. 2008), one chart per component.",
)


@dataclass(frozen=True)
class As(Kind):
    """What click makes of a text.

    Attributes:
        more: arguments of `click.option`.
    """

    more: Mapping[str, Any]


def flag(default: Any = None, **more: Any) -> Any:
    """Return a field of a group that a command alone has; more: arguments of `click.option`."""
    return option(default, As(more))


def path_flag(default: Path | None = None, **more: Any) -> Any:
    """Return a field of such a group that is a path."""
    return flag(default, type=click.Path(path_type=Path), **more)


def _angle(value: Any) -> float:
    """Return radians from 1.57, pi/2, 0.1pi, 90deg or inf."""
    try:
        return math.inf if value.strip().lower() == "inf" else parse_angle(value)
    except OptionError as error:
        raise click.BadParameter(str(error)) from error


def _strength(value: Any) -> float:
    """Return a number."""
    try:
        return float(value)
    except ValueError as error:
        raise click.BadParameter(f"{value!r} is no strength: write a number after it, 1 say") from error


def _direction(value: Any) -> tuple[float, float, float]:
    """Return three coordinates from z, -y or 0,0.5,1."""
    text = value.strip().lower()
    axis = "xyz".find(text[-1:])
    if axis >= 0 and text[:-1] in ("", "+", "-"):
        length = -1.0 if text[0] == "-" else 1.0
        return (length * (axis == 0), length * (axis == 1), length * (axis == 2))
    try:
        one, two, three = (float(word) for word in text.split(","))
    except ValueError as error:
        raise click.BadParameter(f"{value!r} is no direction; write z, -y or 0,0.5,1") from error
    return (one, two, three)


def eye_of(value: Any) -> Any:
    """Return three numbers from 1,0.5,2, or words such as front-right."""
    try:
        return tuple(float(number) for number in value.split(",")) if "," in value else value
    except ValueError as error:
        raise click.BadParameter(f"{value!r} is no direction; write 1,0.5,2 or front-right") from error


def flag_of(name: str) -> str:
    """Return the flag of an option."""
    return "--" + name.replace("_", "-")


def option_flags(group: type, *, one_mesh: bool = True) -> Callable[[Command], Command]:
    """Return a decorator that adds the flags of a group of options to a command.

    one_mesh: also those that name vertices of one mesh.
    """
    added = [each for each in declarations(group).values() if each.flag and each.name not in OF_INPUT]

    def decorate(command: Command) -> Command:
        for each in reversed(added):
            command = _flag(each)(command) if one_mesh or _may_fit_any_mesh(each) else command
        return command

    return decorate


def _may_fit_any_mesh(declaration: Declaration) -> bool:
    """Whether an option has values that make sense for several meshes: words do, vertices do not."""
    return not declaration.one_mesh or bool(getattr(declaration.kind, "words", ()))


def _flag(declaration: Declaration) -> Callable[[Command], Command]:
    """Return what adds one flag; its value is None, or an empty tuple, where it is not given."""
    kind, name = declaration.kind, declaration.name
    more, spelled, doc = dict[str, Any](), flag_of(name), declaration.doc
    if declaration.default is True:
        spelled += f"/--no-{spelled[2:]}"
    match kind:
        case As():
            more = dict(kind.more)
        case declared.Flag():
            more = {"is_flag": True, "default": None}
        case declared.Choice():
            more = {"type": click.Choice(kind.words)}
            if len(kind.words) > 5:
                more["metavar"] = "NAME"
                doc += f" One of {', '.join(kind.words)}."
        case Number(is_angle=True):
            more = {"type": _angle, "metavar": "ANGLE"}
        case Number(is_strength=True):
            more = {"type": _strength, "is_flag": False, "flag_value": 1.0, "metavar": "STRENGTH"}
        case Number():
            more = {"type": int if kind.is_whole else float}
        case declared.Direction():
            more = {"type": _direction, "metavar": "DIRECTION"}
        case declared.Vertices() | declared.VerticesOrEdges():
            more = {"multiple": True, "metavar": "VERTICES|FILE"}
        case declared.WordOrVertices():
            more = {"multiple": True, "metavar": "|".join((*kind.words, "VERTEX[:CURVATURE],...", "FILE"))}
        case declared.Edges():
            more = {"multiple": True, "metavar": "|".join((*kind.words, "FILE"))}
        case declared.Weights():
            more = {"metavar": "NAME|FILE"}
    shown = shown_default(declaration)
    doc += f"  [default: {shown}]" if shown else ""
    names = (spelled, *SPELLINGS.get(name, ()), name)
    return click.option(*names, cls=Grouped, group=declaration.group, help=doc, **more)


def shown_default(declaration: Declaration) -> str:
    """Return an option's default as tables show it; "" where it stands for none."""
    value = declaration.default
    if value is None or value is False or value == ():
        return ""
    if isinstance(declaration.kind, Number) and declaration.kind.is_angle:
        turns = value / math.pi
        return f"{turns:g}pi" if turns >= 1 else f"pi/{1 / turns:g}"
    if value is True:
        return "yes"
    return f"{value:g}" if isinstance(value, float) else str(value)


def keywords(params: Mapping[str, Any], group: type = Options) -> dict[str, Any]:
    """Return the keyword arguments of `coneflat.flatten` that a command line gives, with what `--repair` means.

    Args:
        params: the command's.
        group: the options that it has.

    Raises:
        OptionError: vertices or weights are not what they should be.
        MeshFileError: a file of them cannot be read.
    """
    given = dict(PAPER) if params.get("paper") else {}
    for name, declaration in declarations(group).items():
        value = params.get(name)
        if name not in OF_INPUT and value is not None and value != ():
            given[name] = _value(declaration, value)
    return {**given, **checking(params["repair"])}


def chosen(params: dict[str, Any], group: type[G]) -> G:
    """Return a group of a command's own flags, which are taken out of its parameters."""
    given = {name: params.pop(name) for name in declarations(cast(type, group))}
    return group(**{name: value for name, value in given.items() if value is not None and value != ()})


def _value(declaration: Declaration, value: Any) -> Any:
    """Return what a flag's texts mean."""
    kind, flag = declaration.kind, flag_of(declaration.name)
    match kind:
        case declared.Vertices():
            return tuple(dict.fromkeys(v for text in value for v in read_vertices(flag, text)))
        case declared.VerticesOrEdges():
            return read_vertices_or_pairs(flag, value)
        case declared.WordOrVertices():
            words = [text for text in value if text.replace("-", "").isalpha() and not is_file(text)]
            if words and len(value) > 1:
                raise OptionError(f"{flag} {words[0]} is one choice, and {value[0]}, {value[1]} are two")
            return words[0] if words else read_vertex_map(flag, kind.noun, value)
        case declared.Edges():
            return _edges(flag, kind, value)
        case declared.Weights():
            return read_weights(value)
    return value


def _edges(flag: str, kind: declared.Edges, texts: Sequence[str]) -> Any:
    import numpy as np

    words = [text for text in texts if text in kind.words]
    files = [text for text in texts if text not in kind.words]
    if len(words) > 1:
        raise OptionError(f"{flag} {words[0]} is given twice")
    pairs = np.concatenate([read_pairs(text) for text in files]) if files else None
    if words and pairs is not None:
        return words[0], pairs
    return words[0] if words else pairs


def check_combinations(context: click.Context) -> None:
    """Refuse options that would have no effect."""
    params = context.params
    cones = params["cones"][0] if params["cones"] else "auto"
    method = params["method"] or "exact"
    known = declarations(Options)
    search = [name for name in declarations(ConeOptions) if name != "cones"]
    of_method = [*search, "cones", *declarations(MetricOptions)]
    only = {what: [name for name in known if known[name].only == what] for what in ("sparse", "exact")}
    given = cones not in declared.CONES
    rules = [
        (params["paper"], of_method, "--paper fixes the method"),
        (given, search, "with cones given there is nothing to search"),
        (cones == "none", search, "--cones none searches for none"),
        (cones == "greedy", only["sparse"], "--cones greedy has no such choice"),
        (params["cone_count"] is not None, ("distortion", "max_cones"), "the number of cones is given"),
        (method != "exact", only["exact"], f"--method {method} has no such choice"),
    ]
    refuse(context, rules)


def refuse(context: click.Context, rules: Iterable[tuple[Any, Iterable[str], str]]) -> None:
    """Refuse flags that are given: for each rule that applies, of some names, for a reason."""
    for applies, names, reason in rules:
        for name in names if applies else ():
            if is_given(context, name):
                raise click.UsageError(f"{reason}: leave out {flag_of(name)}", context)


def is_given(context: click.Context, name: str) -> bool:
    """Whether an option stands at the command line."""
    return context.get_parameter_source(name) is ParameterSource.COMMANDLINE


_CURVATURE = re.compile(
    r"(?P<number>[-+]?(?:\d+\.?\d*(?:e[-+]?\d+)?|\.\d+)?)\s*\*?\s*(?P<unit>pi|π|deg|°|rad)?\s*(?:/\s*(?P<by>\d+\.?\d*))?",
    re.IGNORECASE,
)
_UNITS = {"pi": math.pi, "π": math.pi, "deg": math.pi / 180, "°": math.pi / 180, "rad": 1.0, None: 1.0}


def read_vertex_map(flag: str, noun: str, texts: Sequence[str]) -> dict[int, float | None]:
    """Return vertex -> curvature (radians, None where it is to be computed).

    Args:
        flag: the option's name.
        noun: "cone" or "corner".
        texts: each VERTEX[:CURVATURE], several of them with commas, or a file with VERTEX [CURVATURE] on each line.

    Raises:
        OptionError: what stands there is neither, or a vertex is named twice.
        MeshFileError: the file cannot be read.
    """
    given: dict[int, float | None] = {}
    for text, where in _entries(flag, noun, texts):
        parts = re.split(r"[\s,:;]+", text, maxsplit=1)
        try:
            vertex = int(parts[0])
        except ValueError as error:
            raise OptionError(
                f"{where} {text!r} is not VERTEX or VERTEX:CURVATURE, nor a file that is there"
            ) from error
        if vertex in given:
            raise OptionError(f"{where} vertex {vertex} is given as a {noun} twice")
        given[vertex] = parse_curvature(parts[1], f"{where} {text!r}") if len(parts) > 1 else None
    return given


def _entries(flag: str, noun: str, texts: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield what names a vertex, and where it stands."""
    for word in texts:
        if not is_file(word):
            yield from ((text.strip(), flag) for text in word.split(","))
            continue
        lines = [line.split("#", 1)[0].strip() for line in _lines(Path(word))]
        if not any(lines):
            raise OptionError(f"{word} holds no {noun}s")
        yield from ((text, f"{word}, line {number}:") for number, text in enumerate(lines, 1) if text)


def read_vertices(option: str, text: str) -> tuple[int, ...]:
    """Return vertices from "3,17,8", or from a text file of such.

    Raises:
        OptionError: it is neither.
        MeshFileError: the file cannot be read.
    """
    if is_file(text):
        lines = _lines(Path(text))
        option, text = text, " ".join(line.split("#", 1)[0] for line in lines)
    words = text.replace(",", " ").split()
    for word in words:
        if not re.fullmatch(r"[-+]?[0-9]{1,18}", word):
            raise OptionError(f"{option}: {word!r} is no vertex, and there is no such file")
    return tuple(dict.fromkeys(int(word) for word in words))


def read_pairs(name: str) -> IntArray:
    """Return (k, 2) the two vertices on each line of a text file.

    Raises:
        OptionError: a line holds something else.
        MeshFileError: the file cannot be read.
    """
    import numpy as np

    path, pairs = Path(name), []
    for number, line in enumerate(_lines(path), start=1):
        text = line.split("#", 1)[0].strip()
        if not text:
            continue
        if not re.fullmatch(r"[0-9]{1,18}(\s*[,;-]\s*|\s+)[0-9]{1,18}", text):
            raise OptionError(f"{path}, line {number}: {text!r} is not a pair of vertices")
        pairs.append([int(word) for word in re.findall(r"[0-9]+", text)])
    if not pairs:
        raise OptionError(f"{path} holds no pairs of vertices")
    return np.array(pairs, dtype=np.int64)


def read_vertices_or_pairs(option: str, texts: Sequence[str]) -> IntArray:
    """Return vertices (k,) from "3,17,8" or files of such, or pairs (k, 2) from files with two on each line.

    Raises:
        OptionError: it is neither, or both are given.
        MeshFileError: a file cannot be read.
    """
    import numpy as np

    of_pairs = [text for text in texts if is_file(text) and _holds_pairs(Path(text))]
    if not of_pairs:
        return np.array([v for text in texts for v in read_vertices(option, text)], dtype=np.int64)
    if len(of_pairs) < len(texts):
        raise OptionError(f"{option} takes vertices or pairs of them, not both")
    return np.concatenate([read_pairs(text) for text in of_pairs])


def _holds_pairs(path: Path) -> bool:
    lines = [re.split(r"[\s,;-]+", line.split("#", 1)[0].strip()) for line in _lines(path)]
    return all(len(words) == 2 for words in lines if words != [""])


def read_weights(text: str) -> str | FloatArray:
    """Return the numbers of a file, or the text, which then is the name of a property.

    Raises:
        MeshFileError: the file cannot be read.
    """
    import numpy as np

    path = Path(text)
    if not is_file(text):
        if path.suffix:
            raise MeshFileError(f"cannot read weights from {path}: there is no such file")
        return text
    try:
        values = np.load(path, allow_pickle=False) if path.suffix == ".npy" else np.loadtxt(path, ndmin=1)
        return np.asarray(values, dtype=np.float64)
    except (OSError, ValueError, TypeError, EOFError) as error:
        reason = " ".join(str(error).split())
        raise MeshFileError(f"cannot read weights from {path}: {reason}") from error


def parse_angle(text: str) -> float:
    """Return radians from "1.57", "pi/2", "-0.5pi", "90deg".

    Raises:
        OptionError: it is none of these.
    """
    return parse_curvature(text, "", "angle")


def parse_curvature(text: str, where: str, noun: str = "curvature") -> float:
    """Return radians from "1.57", "pi/2", "-0.5pi", "90deg".

    Raises:
        OptionError: it is none of these.
    """
    place = f"{where}: " if where else ""
    match = _CURVATURE.fullmatch(text.strip())
    number = match["number"] if match else ""
    unit = match["unit"].lower() if match and match["unit"] else None
    if match is None or (number in ("", "+", "-") and unit not in ("pi", "π")):
        raise OptionError(f"{place}{text.strip()!r} is no {noun}; write 1.57, pi/2, -0.5pi or 90deg")
    factor = float(number + "1" if number in ("", "+", "-") else number)
    divisor = float(match["by"] or 1)
    if divisor == 0:
        raise OptionError(f"{place}division by zero")
    return factor * _UNITS[unit] / divisor


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise MeshFileError(f"cannot read {path}: {reason}") from error


def is_file(text: str) -> bool:
    """Whether an option's value names a file that is there."""
    try:
        return Path(text).is_file()
    except (OSError, ValueError):
        return False
