"""Files of patterns, read back by other programs."""

from __future__ import annotations

import sys
from xml.etree import ElementTree

import numpy as np
import polyhedra
import pytest
from command import command
from flat_pieces import gores, two_pieces, with_dart

import coneflat
from coneflat.apps.patterns.files.files import PATTERN_FORMATS
from coneflat.apps.patterns.pages.nesting import nested
from coneflat.apps.patterns.pieces.polylines import distances
from coneflat.errors import MeshFileError, OptionError, UnknownFormatError

pytest.importorskip("shapely")

POINTS = 72 / 25.4


def lines_of_pdf(path):
    """Return the polylines of each page, mm, by the operators of its content; closed ones end where they begin."""
    pypdf = pytest.importorskip("pypdf")
    pages = []
    for page in pypdf.PdfReader(path).pages:
        matrix, saved, lines, line = np.eye(3), [], [], []
        for operands, operator in _operations(pypdf, page):
            match operator:
                case b"q":
                    saved.append(matrix)
                case b"Q":
                    matrix = saved.pop()
                case b"cm":
                    a, b, c, d, e, f = map(float, operands)
                    matrix = np.array([[a, b, 0], [c, d, 0], [e, f, 1]]) @ matrix
                case b"m" | b"l":
                    place = (np.array([*map(float, operands), 1.0]) @ matrix)[:2] / POINTS
                    line = [place] if operator == b"m" else [*line, place]
                case b"h":
                    line.append(line[0])
                case b"S" if line:
                    lines.append(np.array(line))
        pages.append(lines)
    return pages


def _operations(pypdf, page):
    return pypdf.generic.ContentStream(page.get_contents(), page.pdf).operations


def lines_of_svg(path):
    """Return the polylines by layer, mm."""
    root = ElementTree.parse(path).getroot()
    assert root.get("width").endswith("mm")
    assert root.get("viewBox") == f"0 0 {root.get('width')[:-2]} {root.get('height')[:-2]}"
    layers = {}
    for group in root.findall("{*}g"):
        lines = layers.setdefault(group.get("id"), [])
        for element in group:
            if element.get("points"):
                points = np.array([word.split(",") for word in element.get("points").split()], dtype=float)
                lines.append(np.vstack([points, points[:1]]) if element.tag.endswith("polygon") else points)
    return layers


def lines_of_dxf(path):
    """Return the polylines by layer, mm."""
    ezdxf = pytest.importorskip("ezdxf")
    document = ezdxf.readfile(path)
    assert document.header["$INSUNITS"] == 4
    assert not document.audit().errors
    layers = {layer.dxf.name: [] for layer in document.layers}
    for entity in document.modelspace().query("LWPOLYLINE"):
        points = np.array(entity.get_points("xy"))
        layers[entity.dxf.layer].append(np.vstack([points, points[:1]]) if entity.closed else points)
    return layers


def lengths(lines):
    return np.sort([distances(line)[-1] for line in lines])


def sides_of(pattern):
    return [side for seam in pattern.seams for side in seam.sides] + [*pattern.borders.hems]


def expected_lengths(pattern):
    return np.sort([distances(pattern.surface.points[side.points])[-1] for side in sides_of(pattern)])


def nearest_gaps(expected, lines):
    """Return how far each expected length is from the nearest one of some lines."""
    return np.abs(expected[:, None] - lengths(lines)[None]).min(axis=1)


@pytest.fixture(scope="module")
def pattern():
    return nested(gores(10, 10, radius=90.0, allowance=6.0, page="none"))


def test_lengths_in_a_pdf_are_those_of_the_pattern(pattern, tmp_path):
    page, *guide = lines_of_pdf(pattern.save(tmp_path / "globe.pdf"))
    assert nearest_gaps(expected_lengths(pattern), page).max() < 1e-3
    # The ruler is below the pattern.
    ruler = min(page, key=lambda line: line[:, 1].min())
    assert np.ptp(ruler, axis=0) == pytest.approx([100, 0], abs=1e-3)
    assert guide


def test_lengths_on_tiled_pages_are_those_of_the_pattern(tmp_path):
    pattern = nested(gores(10, 10, radius=90.0, allowance=6.0, page="A4"))
    pages = lines_of_pdf(pattern.save(tmp_path / "globe.pdf"))
    lines = [line for page in pages for line in page]
    assert nearest_gaps(expected_lengths(pattern), lines).max() < 1e-3
    # The ruler is on the first page.
    assert np.abs(lengths(pages[0]) - 100).min() < 1e-3


def test_texts_of_a_dxf_are_those_of_the_drawing(tmp_path):
    ezdxf = pytest.importorskip("ezdxf")
    cube = polyhedra.cube()
    net = coneflat.pattern(cube.vertices, cube.faces, kind="net", unit="cm", scale=5, page="none")
    document = ezdxf.readfile(net.save(tmp_path / "cube.dxf"))
    texts = sorted(entity.dxf.text for entity in document.modelspace().query("TEXT"))
    assert texts == sorted(text.text for text in net.drawing().texts)
    assert any("\u00b0" in text for text in texts)


@pytest.mark.parametrize(("ending", "read"), [(".svg", lines_of_svg), (".dxf", lines_of_dxf)])
def test_lengths_in_drawings_are_those_of_the_pattern(pattern, tmp_path, ending, read):
    layers = read(pattern.save(tmp_path / f"globe{ending}"))
    assert {"cut", "fold", "mark", "text"} <= set(layers)
    assert len(layers["cut"]) == 10
    assert not layers["fold"]
    assert nearest_gaps(expected_lengths(pattern), layers["mark"]).max() < 1e-3
    points = np.vstack(layers["cut"])
    drawing = pattern.drawing()
    assert (points.min(axis=0) >= 1 - 1e-3).all()
    assert (points.max(axis=0) <= [drawing.width - 1 + 1e-3, drawing.height - 1 + 1e-3]).all()


def test_partners_in_a_file_are_equally_long(pattern, tmp_path):
    sewn = lines_of_svg(pattern.save(tmp_path / "globe.svg"))["mark"]
    sides = np.sort([distances(line)[-1] for line in sewn if len(line) > 3])
    assert len(sides) == 20
    assert np.ptp(sides.reshape(-1, 2), axis=1).max() < 0.01


@pytest.mark.parametrize("ending", PATTERN_FORMATS)
def test_the_same_pattern_gives_the_same_file(tmp_path, ending):
    contents = [
        nested(two_pieces()).save(tmp_path / f"{i}" / f"toy{ending}").read_bytes() for i in _folders(tmp_path)
    ]
    assert contents[0] == contents[1]


def _folders(path):
    for i in (0, 1):
        (path / str(i)).mkdir()
        yield i


def test_a_pdf_is_printed_without_scaling(tmp_path):
    pypdf = pytest.importorskip("pypdf")
    reader = pypdf.PdfReader(nested(two_pieces(page="letter")).save(tmp_path / "toy.pdf"))
    assert reader.trailer["/Root"]["/ViewerPreferences"]["/PrintScaling"] == "/None"
    assert all([*map(float, page.mediabox[2:])] == pytest.approx([612, 792]) for page in reader.pages)
    texts = "\n".join(page.extract_text() for page in reader.pages)
    assert "A (2)" in texts
    assert "100 mm" in texts
    assert "4 inches" in texts


def test_layers_of_a_dxf_have_colours_and_texts(tmp_path):
    ezdxf = pytest.importorskip("ezdxf")
    document = ezdxf.readfile(nested(with_dart()).save(tmp_path / "toy.dxf"))
    colours = {name: document.layers.get(name).color for name in ("cut", "fold", "mark", "text")}
    assert len(set(colours.values())) == 4
    texts = {entity.dxf.text: entity.dxf.height for entity in document.modelspace().query("TEXT")}
    assert {"1", "dart A"} <= set(texts)
    assert min(texts.values()) > 1


@pytest.mark.parametrize("ending", [".png", ".obj", ""])
def test_other_endings_are_errors(tmp_path, ending):
    with pytest.raises(UnknownFormatError, match="patterns are written as"):
        two_pieces().save(tmp_path / f"toy{ending}")


def test_a_folder_that_does_not_exist_is_an_error(tmp_path):
    with pytest.raises(MeshFileError):
        two_pieces().save(tmp_path / "missing" / "toy.svg")


@pytest.mark.parametrize(
    ("package", "ending"), [("reportlab.pdfgen.canvas", ".pdf"), ("ezdxf", ".dxf"), ("shapely", ".svg")]
)
def test_a_missing_package_is_an_error_that_says_what_to_install(tmp_path, monkeypatch, package, ending):
    pattern = nested(two_pieces())
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(OptionError, match=r'pip install "coneflat\[patterns\]"'):
        pattern.save(tmp_path / f"toy{ending}")
    assert not [*tmp_path.iterdir()]


CUBE = """v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1
f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8
"""


def test_the_command_writes_a_net(tmp_path):
    (tmp_path / "cube.obj").write_text(CUBE)
    words = ["pattern", "cube.obj", "--kind", "net", "--unit", "cm", "--scale", "4", "--page", "letter"]
    made = command(*words, "-o", "cube.svg", "-o", "cube.pdf", "--report", "cube.json", cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    assert (tmp_path / "cube.json").exists()
    assert "pieces" in made.stdout
    cut = lines_of_svg(tmp_path / "cube.svg")["cut"]
    assert len(cut) == 1
    twice = command(*words, "-o", "cube.svg", "-o", "./cube.svg", cwd=tmp_path)
    assert twice.returncode == 2
    assert "cube.svg is both the output 1 and the output 2" in twice.stderr
    failed = command(*words, "--require", "pieces>=2", "-o", "cube.dxf", cwd=tmp_path)
    assert failed.returncode == 3
    assert "pieces is 1, but pieces>=2 is required" in failed.stderr
    assert len(lines_of_dxf(tmp_path / "cube.dxf")["fold"]) >= 5


def test_the_command_says_the_size_where_there_is_no_unit(tmp_path):
    (tmp_path / "cube.obj").write_text(CUBE)
    made = command("pattern", "cube.obj", "--kind", "net", cwd=tmp_path)
    assert made.returncode == 2
    assert "mm" in made.stderr
    assert not (tmp_path / "cube.pdf").exists()


def test_the_command_checks_files_before_it_works(tmp_path):
    made = command("pattern", "missing.obj", "--unit", "mm", "-o", "toy.png", cwd=tmp_path)
    assert made.returncode == 2
    assert "patterns are written as" in made.stderr
