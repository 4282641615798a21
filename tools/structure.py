"""The structure of the package: its subpackages, their imports and their sizes.

`python tools/structure.py` prints the sizes; `tools/remake.py` draws the packages for the documentation;
`tests/test_structure.py` holds the rules.
"""

from __future__ import annotations

import ast
import io
import re
import tokenize
from dataclasses import dataclass
from functools import cache
from graphlib import TopologicalSorter
from html import escape
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1] / "src" / "coneflat"

#: The stages, which do not import each other; only `flattening.py` combines them.
STAGES = ("cones", "metric", "seams", "layout", "atlas", "measures")
#: What a package or a file beside the packages holds, in about five words.
HOLDS = {
    "": "what users import, by name",
    "base": "errors, arrays, kernels, threads, text",
    "mesh": "connectivity, checks, repair, cutting open",
    "options": "every option, declared once",
    "geometry": "lengths, angles, flips, predicates, overlap",
    "linalg": "factorization, Newton, shortest paths",
    "stages": "what passes between the stages",
    "cones": "where the curvature goes",
    "metric": "flat metrics: linear, exact",
    "seams": "costs of seams, the seam tree",
    "layout": "flat triangles become points",
    "optimise": "less distortion, no flipped triangle",
    "atlas": "overlaps separated, charts packed",
    "measures": "distortion, guarantees, report",
    "result": "what a flattening returns",
    "io": "OBJ, PLY, STL, OFF, glTF, NPZ",
    "source": "from the input to connected parts",
    "flattening": "the method on one component",
    "groups": "copies, flat disks, small ones together",
    "evaluate": "from layouts to one result",
    "bounds": "which of two layouts is better",
    "retries": "what is laid out again, why",
    "flattener": "flatten: from input to result",
    "repacking": "charts moved, packed around others",
    "curves": "distortion by number of cones",
    "apps.uv_measures": "measures of any mesh's UVs",
    "from_uv": "a file's own UVs as a flattening",
    "sample": "the model that ships",
    "warm_up": "compilation of all kernels",
    "textures": "shortest seams for textures",
    "quadmesh": "quads from an integer grid",
    "apps": "commands, page, studio, batch",
    "xatlas": "the interface of xatlas",
    "__main__": "python -m coneflat",
}


@dataclass(frozen=True)
class Size:
    """The size of some code.

    Attributes:
        files: how many.
        lines: of code, without docstrings, comments and blank lines.
    """

    files: int
    lines: int

    def __add__(self, size: Size) -> Size:
        return Size(self.files + size.files, self.lines + size.lines)


def size_of(path: Path) -> Size:
    """Return the size of a file."""
    return _size_of(path, path.stat().st_mtime_ns)


@cache
def _size_of(path: Path, _: int) -> Size:
    text = path.read_text(encoding="utf-8")
    tree = ast.parse(text)
    documented = set[int]()
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
            first = node.body[0] if node.body else None
            if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
                documented.update(range(first.lineno, (first.end_lineno or first.lineno) + 1))
    silent = (
        tokenize.COMMENT,
        tokenize.NL,
        tokenize.NEWLINE,
        tokenize.INDENT,
        tokenize.DEDENT,
        tokenize.ENDMARKER,
    )
    lines = set[int]()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in silent:
            lines.update(range(token.start[0], token.end[0] + 1))
    return Size(1, len(lines - documented))


def package_of(name: str) -> str:
    """Return the package that a module belongs to: an application, a folder, or the module itself."""
    parts = name.split(".")
    if name == "errors":  # Every package may raise these.
        return "base"
    return ".".join(parts[:2]) if parts[0] == "apps" else parts[0]


def sizes(package: Path = PACKAGE) -> dict[str, Size]:
    """Return the sizes of the packages."""
    package_sizes: dict[str, Size] = {}
    for name, module in read_modules(package).items():
        key = package_of(name)
        package_sizes[key] = package_sizes.get(key, Size(0, 0)) + size_of(module.path)
    return package_sizes


def imported_packages(modules: dict[str, Module]) -> dict[str, frozenset[str]]:
    """Return the packages that each package imports, also late; the exceptions of the rules left out."""
    imports_of: dict[str, set[str]] = {}
    for name, module in modules.items():
        importer = package_of(name)
        imported = {package_of(imported_name) for imported_name in module.imports | module.late_imports}
        if importer == "":
            imported = set()
        imports_of.setdefault(importer, set()).update(imported - {importer, ""})
    return {name: frozenset(imported) for name, imported in imports_of.items()}


def file_circles(modules: dict[str, Module]) -> list[list[str]]:
    """Return the groups of modules that import each other in circles, late imports counted.

    A group is a strongly connected component with several modules. What only type checkers import does not count, nor
    do names of modules in text: public names of a package's `__init__`, and `EntryPoint`.
    """
    reached = {name: _reached(name, modules) for name in modules}
    circles = {
        tuple(sorted(member for member in reached[name] if name in reached[member])) for name in modules
    }
    return [list(circle) for circle in sorted(circles) if circle]


def _reached(name: str, modules: dict[str, Module]) -> set[str]:
    """Return the modules that a module imports, directly or through others."""
    reached, waiting = set[str](), [name]
    while waiting:
        module = modules[waiting.pop()]
        unvisited = (module.imports | module.late_imports) & modules.keys() - reached
        reached |= unvisited
        waiting += unvisited
    return reached


def levels(modules: dict[str, Module]) -> dict[str, int]:
    """Return the level of each package: one above the highest that it imports.

    Raises:
        graphlib.CycleError: packages import each other in a circle.
    """
    graph = imported_packages(modules)
    package_levels: dict[str, int] = {}
    for name in TopologicalSorter(graph).static_order():
        package_levels[name] = 1 + max((package_levels[lower] for lower in graph.get(name, ())), default=0)
    return package_levels


@dataclass(frozen=True)
class Package:
    """A package, or a file beside the packages.

    Attributes:
        name: "" for the files of the package itself.
        holds: what is in it, in a few words.
        size: how large it is.
        below: the packages that it imports.
    """

    name: str
    holds: str
    size: Size
    below: frozenset[str]


@dataclass(frozen=True)
class Module:
    """A file of the package.

    Attributes:
        name: without the package's, "" for the package itself.
        path: the file.
        imports: modules of the package that it imports when it is loaded.
        late_imports: those that functions of it import when they are called.
    """

    name: str
    path: Path
    imports: frozenset[str]
    late_imports: frozenset[str]


def module_paths(package: Path = PACKAGE) -> dict[str, Path]:
    """Return the files of the modules of a package by name."""
    paths = {}
    for path in sorted(package.rglob("*.py")):
        parts = path.relative_to(package).with_suffix("").parts
        paths[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return paths


@cache
def read_modules(package: Path = PACKAGE) -> dict[str, Module]:
    """Return the modules of a package by name; what only type checkers import does not count."""
    paths = module_paths(package)
    return {name: _read(name, path, paths) for name, path in paths.items()}


@cache
def _exports(package: Path) -> frozenset[str]:
    """Return the names that the file of a package exports."""
    for node in ast.parse(package.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            return frozenset(ast.literal_eval(node.value))
    return frozenset()


def _read(name: str, path: Path, paths: dict[str, Path]) -> Module:
    now, late = set[str](), set[str]()
    package = name.split(".") if path.stem == "__init__" else name.split(".")[:-1]
    package = [part for part in package if part]

    def walk(node: ast.AST, inside: bool) -> None:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING":
                continue
            if isinstance(child, ast.ImportFrom) and child.level:
                base = package[: len(package) - child.level + 1] + (child.module or "").split(".")
                home = ".".join(part for part in base if part)
                for alias in child.names:
                    full = f"{home}.{alias.name}".strip(".")
                    # A package may export a function by the name of its module.
                    is_module = full in paths and (
                        home not in paths or alias.name not in _exports(paths[home])
                    )
                    (late if inside else now).add(full if is_module else home)
            walk(child, inside or isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)))

    walk(ast.parse(path.read_text(encoding="utf-8")), False)
    return Module(name, path, frozenset(now - {name}), frozenset(late - now - {name}))


def packages_by_level(package: Path = PACKAGE) -> list[list[Package]]:
    """Return the packages of each level, from the lowest one up; the applications count as one."""
    imported, sized = imported_packages(read_modules(package)), sizes(package)

    def describe(name: str) -> Package:
        below = {
            _merged(lower)
            for package_name in imported
            if _merged(package_name) == name
            for lower in imported[package_name]
        }
        size = sum(
            (size for package_name, size in sized.items() if _merged(package_name) == name), Size(0, 0)
        )
        return Package(name, HOLDS.get(name, name), size, frozenset(below - {name}))

    return [[describe(name) for name in row] for row in names_by_level(package)]


def names_by_level(package: Path = PACKAGE) -> list[list[str]]:
    """Return the names of the packages of each level, from the lowest one up; the applications count as one."""
    package_levels = levels(read_modules(package))
    names = sorted({_merged(name) for name in package_levels if name})
    own_level = {
        name: max(
            package_levels[package_name] for package_name in package_levels if _merged(package_name) == name
        )
        for name in names
    }
    own_level |= {name: max(own_level.values()) for name in ("apps",) if name in own_level}
    heights = sorted(set(own_level.values()))
    return [[name for name in names if own_level[name] == height] for height in heights]


def _merged(name: str) -> str:
    """Return the name of the package in the drawing: that of all applications is one."""
    return name.split(".")[0]


# Points of the drawing: height of a row, gap between two, width of a letter of a name and of small print.
ROW, GAP, LETTER, SMALL = 58.0, 34.0, 8.6, 6.0
WIDTH = 1640.0


def draw_structure(package: Path = PACKAGE) -> str:
    """Return a drawing of the structure as SVG: packages by level, with arrows to those that each imports.

    A package that is reached through another one has no arrow of its own.
    """
    heights = packages_by_level(package)
    packages = {drawn.name: drawn for row in heights for drawn in row}
    places: dict[str, tuple[float, float, float]] = {}  # middle, top and width
    for level, row in enumerate(reversed(heights)):
        widths = [
            max(LETTER * len(_title(drawn)), SMALL * max(len(drawn.holds), len(_size(drawn)))) + 20
            for drawn in row
        ]
        gap = (WIDTH - sum(widths)) / (len(row) + 1)
        left = gap
        for drawn, width in zip(row, widths, strict=True):
            places[drawn.name] = (left + width / 2, 10 + level * (ROW + GAP), width)
            left += width + gap
    height = 20 + len(heights) * (ROW + GAP) - GAP
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:g} {height:g}" font-family="sans-serif">',
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" '
        'orient="auto"><path d="M0 0 8 4 0 8z" fill="#7d8f9e"/></marker></defs>',
        f'<rect width="{WIDTH:g}" height="{height:g}" fill="#ffffff"/>',
    ]
    for name, drawn in packages.items():
        lines += [_arrow(places[name], places[lower]) for lower in sorted(_direct(drawn, packages))]
    for number, row in enumerate(heights):
        for drawn in row:
            lines.append(_box(drawn, number, *places[drawn.name]))
    return "\n".join([*lines, "</svg>", ""])


def packages_drawn(drawing: str) -> list[list[str]]:
    """Return the names of the packages that a drawing shows, level by level from the lowest one up."""
    heights: dict[int, list[str]] = {}
    for name, row in re.findall(r'<g id="package-(\w*)" data-level="(\d+)">', drawing):
        heights.setdefault(int(row), []).append(name)
    return [heights[number] for number in sorted(heights)]


def _title(described: Package) -> str:
    return described.name or "coneflat"


def _size(described: Package) -> str:
    return f"{described.size.files} file{'s'[: described.size.files > 1]}, {described.size.lines:,} lines of code"


def _direct(importer: Package, packages: dict[str, Package]) -> set[str]:
    """Return the imported packages that are not reached through another imported package."""
    reached: set[str] = set()
    for imported in importer.below:
        waiting = set(packages[imported].below)
        while waiting:
            name = waiting.pop()
            if name not in reached:
                reached.add(name)
                waiting |= packages[name].below
    return {imported for imported in importer.below - reached if imported}


def _arrow(start: tuple[float, float, float], end: tuple[float, float, float]) -> str:
    (x, top, _), (to_x, to_top, _) = start, end
    if top == to_top:  # neighbours on a row
        side = 1 if to_x > x else -1
        line = f"M{x + side * start[2] / 2:.0f} {top + ROW / 2:.0f}H{to_x - side * end[2] / 2:.0f}"
    else:
        y, middle = top + ROW, (top + ROW + to_top) / 2
        line = f"M{x:.0f} {y:.0f}C{x:.0f} {middle:.0f} {to_x:.0f} {middle:.0f} {to_x:.0f} {to_top:.0f}"
    return f'<path d="{line}" fill="none" stroke="#7d8f9e" stroke-width="1.2" marker-end="url(#tip)"/>'


def _box(described: Package, row: int, x: float, top: float, width: float) -> str:
    def text(below: float, size: int, colour: str, words: str, weight: str = "normal") -> str:
        return (
            f'<text x="{x:.0f}" y="{top + below:.0f}" font-size="{size}" font-weight="{weight}" fill="{colour}" '
            f'text-anchor="middle">{escape(words)}</text>'
        )

    return (
        f'<g id="package-{described.name}" data-level="{row}"><rect x="{x - width / 2:.0f}" y="{top:.0f}" '
        f'width="{width:.0f}" height="{ROW:g}" rx="4" fill="#e9eff4" stroke="#40566a"/>'
        + text(20, 14, "#1d2b36", _title(described), "bold")
        + text(36, 11, "#1d2b36", described.holds)
        + text(51, 10, "#5c6f7e", _size(described))
        + "</g>"
    )


def main() -> None:
    """Print the sizes of the packages and their levels."""
    package_sizes, heights = sizes(), levels(read_modules())
    print(f"{'package':16}{'level':>6}{'files':>7}{'lines':>8}")
    for name, size in [*package_sizes.items(), ("all", sum(package_sizes.values(), Size(0, 0)))]:
        print(f"{name:16}{heights.get(name, '') if name else '':>6}{size.files:>7}{size.lines:>8}")


if __name__ == "__main__":
    main()
