"""Every example in the documentation runs; the options, files and modules that it names are there."""

from __future__ import annotations

import lzma
import re
import shlex
from pathlib import Path

import click
import pytest
from click.testing import CliRunner
from markers import ROOT
from structure import PACKAGE

import coneflat
from coneflat.apps.cli.main import cli

PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("**/*.md"))]
#: A flag, not a part of a word or of a line.
FLAG = re.compile(r"(?<![\w-])--[a-z]+(?:-[a-z]+)*")
HELP = {"--help", "--version"}


def flags(command: click.Command) -> set[str]:
    return HELP | {flag for p in command.params for flag in (*p.opts, *p.secondary_opts)}


#: Other programs whose flags are their own.
FOREIGN = ("pip ", "docker ", "python -m build")
ALL_FLAGS = set().union(*map(flags, cli.commands.values()))


@pytest.mark.parametrize(
    "page",
    [PAGES[0], *(pytest.param(page, marks=pytest.mark.slow) for page in PAGES[1:])],
    ids=[page.name for page in PAGES],
)
def test_examples_run(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    for block in re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
        exec(compile(block, str(page), "exec"), names)


@pytest.mark.slow
def test_commands_for_game_engines_run_as_printed(tmp_path, monkeypatch):
    pytest.importorskip("PIL")
    monkeypatch.chdir(tmp_path)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    Path("spot.obj").write_bytes(lzma.decompress((ROOT / "tests" / "data" / "spot.obj.xz").read_bytes()))
    text = (ROOT / "docs" / "how-to" / "game-engine.md").read_text(encoding="utf-8")
    lines = [line for block in re.findall(r"```sh\n(.*?)```", text, re.DOTALL) for line in block.splitlines()]
    assert any(line.startswith("coneflat transfer") for line in lines)
    for line in lines:
        done = CliRunner().invoke(cli, shlex.split(line)[1:])
        assert done.exit_code == 0, (line, done.output)


@pytest.mark.parametrize("page", [*PAGES, ROOT / "CHANGELOG.md"], ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text(encoding="utf-8")):
        assert (page.parent / target).exists(), target


def test_readme_gives_the_shape_of_the_sample():
    result = coneflat.flatten(coneflat.sample_path(), max_cones=20)
    assert f"{result.corner_uv.shape}" in (ROOT / "README.md").read_text(encoding="utf-8")


def unknown_flags(text: str) -> list[str]:
    """Return the flags in a page's code that nothing has: no command, and no script of ours."""
    blocks = re.findall(r"```.*?\n(.*?)```", text, re.DOTALL)
    code = [line for block in blocks for line in block.splitlines()]
    code += re.findall(r"`([^`\n]+)`", re.sub(r"```.*?```", "", text, flags=re.DOTALL))
    unknown = []
    for line in code:
        for part in re.split(r"&&|\|\||[|;#](?= )", line):
            script = re.search(r"python (\S+\.py)", part)
            command = re.search(r"coneflat ([a-z]+)", part)
            possible = ALL_FLAGS | HELP
            if part.removeprefix("RUN ").lstrip().startswith(FOREIGN):
                continue
            if script:
                possible = set(FLAG.findall((ROOT / script[1]).read_text(encoding="utf-8")))
            elif command and command[1] in cli.commands:
                possible = flags(cli.commands[command[1]])
            unknown += [f"{flag} in {line.strip()!r}" for flag in FLAG.findall(part) if flag not in possible]
    return unknown


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_flags_exist(page):
    assert not unknown_flags(page.read_text(encoding="utf-8"))


def test_flags_that_do_not_exist_are_found():
    text = "`--nowhere`, `--eye`\n```sh\nconeflat flatten a.obj --eye x | cat\nconeflat figure a.obj --eye x\n```\n"
    assert unknown_flags(text) == [
        "--eye in 'coneflat flatten a.obj --eye x | cat'",
        "--nowhere in '--nowhere'",
    ]


def test_every_option_is_described():
    text = {
        name: (ROOT / "docs" / "reference" / f"{name}.md").read_text(encoding="utf-8")
        for name in ("command-line", "figures")
    }
    pages = {"flatten": text["command-line"], "figure": text["figures"]}
    for name, command in cli.commands.items():
        assert f"coneflat {name}" in text["command-line"]
        for parameter in command.params:
            if name in pages and parameter.param_type_name == "option":
                assert any(f"{option}" in pages[name] for option in parameter.opts), parameter.name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_modules_exist(page):
    """What is named as `coneflat.room.file.name` can be imported; what is named as `room/file.py` is there."""
    text = page.read_text(encoding="utf-8")
    for dotted in set(re.findall(r"(?<![\w./-])coneflat((?:\.[A-Za-z_]\w*)+)", text)):
        value = coneflat
        for name in dotted[1:].split("."):
            path = getattr(value, "__path__", None)
            if path is not None and not hasattr(value, name):
                __import__(f"{value.__name__}.{name}")
            assert hasattr(value, name), f"coneflat{dotted}"
            value = getattr(value, name)
    for path in set(re.findall(r"`((?:\w+/)+(?:\w+\.py)?)`", text)):
        assert any((root / path).exists() for root in (ROOT, PACKAGE)), path


#: Private words that were replaced by the field's terms, as regular expressions.
REPLACED_WORDS = [
    r"(?<![Mm]atching )\bpursuit\b",
    r"\bun-?held\b",
    r"\bevened out\b",
    r"\bpolish",
    r"\btakes_rest\b|\bgo_on\b|\bmeanwhile\(|\bshake|\b_with_all_means\b|\bLaidOut\b",
    r"\b(FEW|MANY|HUGE|SMALL|TOGETHER|NEAR|DEARER|NOTHING|SAME|QUARTER)\b|class (Last|Later)\b",
    r"\bupside down\b|\bupright\b|\bturned over\b",
    r"\bwhole (number|turn)s?\b",
    r"\bdearer\b|\bnext to nothing\b",
    r"\bcut all the same\b",
    r"(?<!there )\bis no (requirement|mesh|vertex|number|integer)\b",
    r"\btoo small for numbers\b",
    r"\b(by|of) (itself|themselves)\b",
    r"\bfalls? short\b",
    r"\bgo on where\b",
    r"\bhang(s|ing)? together\b",
]


def test_private_words_are_replaced():
    pages = [*PAGES, ROOT / "CHANGELOG.md"]
    pages += [path for kind in ("py", "js", "html") for path in (ROOT / "src").rglob(f"*.{kind}")]
    lines = [
        f"{path.relative_to(ROOT)}:{number}: {match[0]}"
        for path in pages
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        for match in re.finditer("|".join(REPLACED_WORDS), line)
    ]
    assert not lines, "\n".join(lines)
