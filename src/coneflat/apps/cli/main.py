"""The `coneflat` command: its subcommands, and the handling of errors and signals."""

from __future__ import annotations

import gc
import os
import shlex
import signal
import sys
import time
from _thread import start_new_thread
from contextlib import suppress
from pathlib import Path
from types import FrameType
from typing import IO, Any, NoReturn

import click

from ... import ConeflatError, __version__
from ...base import Use, endings, inner_calls
from .batch_command import batch
from .blender_command import blender
from .brain_command import brain
from .checks import ExitCode
from .cones_command import cones
from .figure_commands import demo, figure
from .flatten_commands import flatten, unwrap
from .measure_command import measure
from .pattern_command import pattern
from .quads_command import quads
from .transfer_command import transfer
from .view_commands import studio, view
from .warm_up_command import warm_up


class Interrupted(KeyboardInterrupt):
    """A signal; after a plain KeyboardInterrupt inside `exec`, Python ends with the code of SIGINT in any case."""


class Commands(click.Group):
    """The commands; `coneflat help` is their help, and a file instead of a command gets advice."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse arguments: help is the option --help of the command after it."""
        return super().parse_args(ctx, [*args[1:2], "--help"] if args[:1] == ["help"] else args)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the command of arguments; if that is a file, the error names the commands for it."""
        if args[0] not in self.commands and (names := commands_for(args[0])):
            advice = " or ".join(f"`coneflat {name} {shlex.quote(args[0])}`" for name in names)
            ctx.fail(f"{args[0]} is a file, not a command: use {advice}.")
        return super().resolve_command(ctx, args)


def commands_for(file: str) -> tuple[str, ...]:
    """Return the commands that a file is usually an argument of; none if it does not look like a file."""
    ending = Path(file).suffix.lower()
    if ending in endings(Use.MESH):
        return "flatten", "unwrap", "studio"
    return {".npz": ("view",), ".json": ("studio",)}.get(ending, ())


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="coneflat")
@click.pass_context
def cli(context: click.Context) -> None:
    """Flatten triangle meshes into the plane: conformal UV maps with automatic cones and seams."""
    context.with_resource(inner_calls())  # Notes are printed, so they are not warnings as well.


for command in (
    flatten, unwrap, transfer, batch, brain, quads, pattern, measure, cones, figure, view, studio, blender, demo,
    warm_up,
):  # fmt: skip
    cli.add_command(command)


def main() -> NoReturn:
    """Run the command; every failure prints one line to stderr and gives a nonzero exit code."""
    opened = _open_streams()
    # The number of a signal does not always arrive with the error that it causes inside a compiled function.
    received = list[int]()
    _handle_signals(received)
    # Imports allocate half a million objects and no garbage. Garbage collection after every 700 objects, the
    # default, takes a tenth of the time of a short run.
    gc.set_threshold(100_000, 50, 50)
    # numpy and SciPy have an OpenBLAS each, which takes as long to start threads that are never used.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    code = _close_streams(opened, _exit_code(received))
    # At exit, Python collects garbage among all objects three times: a tenth of the time of a short run.
    gc.freeze()
    sys.exit(code)


def _handle_signals(received: list[int]) -> None:
    """Let signals interrupt the command, and append their numbers to a list."""

    def give_up() -> NoReturn:
        time.sleep(10)
        os.write(2, b"coneflat: error: interrupted, and ended by force\n")
        os._exit(ExitCode.SIGNALLED + received[0])

    def interrupt(number: int, _: FrameType | None) -> NoReturn:
        received.append(number)
        # An exception inside of a call of `threading` or llvmlite can leave a lock for which another thread waits
        # without end. `threading` would need its locks to start this thread.
        start_new_thread(give_up, ())
        raise Interrupted

    for number in {1, 2, 15} & signal.valid_signals():  # SIGHUP, which Windows has not, SIGINT, SIGTERM
        if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
            signal.signal(number, interrupt)


def _exit_code(received: list[int]) -> int:
    """Run the command and return its exit code, after a failure with a message; received: numbers of signals."""
    try:
        return _call()
    except click.ClickException as error:
        return _fail(f"{error.format_message()}{_hint(error)}", ExitCode.USER_ERROR)
    except ConeflatError as error:
        return _fail(str(error), ExitCode.USER_ERROR)
    except (KeyboardInterrupt, click.exceptions.Abort) as error:
        return _fail_interrupted(received, str(error.__cause__ or error))
    except OSError as error:
        # Errors of files are raised as ConeflatError, so this one is from the terminal, a full device, or a pipe whose
        # reader has ended as in `coneflat ... | head`.
        _discard(sys.stdout)
        return _fail_to_print(error)
    except MemoryError:
        return _fail("not enough memory for this mesh", ExitCode.INTERNAL_ERROR)
    except Exception as error:
        if os.environ.get("CONEFLAT_DEBUG"):
            raise
        # An interrupt inside a compiled function arrives as another error, which it may or may not have as its cause.
        if received or isinstance(error.__cause__ or error.__context__, KeyboardInterrupt):
            return _fail_interrupted(received)
        return _fail(
            f"internal error, please report it: {type(error).__name__}: {error} (CONEFLAT_DEBUG=1 shows where)",
            ExitCode.INTERNAL_ERROR,
        )


def _call() -> int:
    """Run the command and return its exit code; without arguments, print the help."""
    try:
        code = cli.main(standalone_mode=False)
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message())
        return ExitCode.USER_ERROR
    return code if isinstance(code, int) else 0


def _open_streams() -> list[IO[Any]]:
    """Connect closed standard streams to the null device, and what libraries print on standard output.

    No other file gets the descriptors of closed streams then, and a result on standard output stays whole.

    Returns:
        The streams that were opened.
    """
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(descriptor)
    opened: list[IO[Any]] = []
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            opened.append(open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115
            setattr(sys, name, opened[-1])
    is_replaced = sys.stdout is not sys.__stdout__  # By a test.
    if not is_replaced and not (os.name == "nt" and sys.stdout.isatty()):
        stdout = os.dup(1)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        sys.stdout = open(stdout, "w", encoding=sys.stdout.encoding, errors=sys.stdout.errors)  # noqa: SIM115
        opened.append(sys.stdout)
    return opened


def _close_streams(opened: list[IO[Any]], code: int) -> int:
    """Print buffered output, close the opened streams, and return the exit code; 1 if it cannot be printed."""
    error = _flush(sys.stdout)
    if error is not None and code == 0:
        code = _fail_to_print(error)
    _flush(sys.stderr)
    for stream in opened:
        stream.close()
    return code


def _flush(stream: IO[Any]) -> OSError | None:
    """Print the buffered output of a stream; if that fails, discard it and return the error."""
    try:
        stream.flush()
    except OSError as error:
        _discard(stream)
        return error
    return None


def _discard(stream: IO[Any]) -> None:
    """Connect a stream to the null device, so that Python can flush it at its exit."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, stream.fileno())
    os.close(null)


def _fail_to_print(error: OSError) -> int:
    if isinstance(error, BrokenPipeError):
        return ExitCode.INTERNAL_ERROR
    return _fail(f"cannot print: {error.strerror or error}", ExitCode.INTERNAL_ERROR)


def _fail_interrupted(received: list[int], message: str = "") -> int:
    # Without a signal that was received, it was SIGINT.
    code = ExitCode.SIGNALLED + (received or [2])[0]
    return _fail(message or "interrupted; no incomplete file was left", code)


def _fail(message: str, code: int) -> int:
    with suppress(OSError):  # The exit code remains if stderr is full.
        click.echo(f"coneflat: error: {' '.join(message.split())}", err=True)
    return code


def _hint(error: click.ClickException) -> str:
    context = getattr(error, "ctx", None)
    return f" (see `{context.command_path} --help`)" if context is not None else ""
