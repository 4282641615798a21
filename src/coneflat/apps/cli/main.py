"""The `coneflat` command: its subcommands, and the handling of errors and signals."""

from __future__ import annotations

import gc
import os
import signal
import sys
import time
from _thread import start_new_thread
from types import FrameType
from typing import NoReturn

import click

from ... import ConeflatError, __version__
from ...base import inner_calls
from .batch import batch
from .cones import cones
from .figure import demo, figure
from .flatten import flatten, unwrap
from .measure import measure
from .more import blender, brain, transfer
from .peers import compare
from .quads import quads
from .shared import ExitCode
from .view import studio, view
from .warm_up import warm_up


class Interrupted(KeyboardInterrupt):
    """A signal; after a plain KeyboardInterrupt inside `exec`, Python ends with the code of SIGINT in any case."""


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="coneflat")
@click.pass_context
def cli(context: click.Context) -> None:
    """Flatten triangle meshes into the plane: conformal UV maps with automatic cones and seams."""
    context.with_resource(inner_calls())  # Notes are printed, so they are not warnings as well.


for command in (
    flatten, unwrap, transfer, batch, brain, quads, measure, cones, figure, view, studio, blender, compare, demo,
    warm_up,
):  # fmt: skip
    cli.add_command(command)


def main() -> NoReturn:
    """Run the command; every failure prints one line to stderr and gives a nonzero exit code."""
    _open_streams()
    # The number of a signal does not always arrive with the error that it causes inside a compiled function.
    received = list[int]()

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
    # Imports allocate half a million objects and no garbage. Garbage collection after every 700 objects, the
    # default, takes a tenth of the time of a short run.
    gc.set_threshold(100_000, 50, 50)
    # numpy and SciPy have an OpenBLAS each, which takes as long to start threads that are never used.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        code = cli.main(standalone_mode=False)
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message())
        code = ExitCode.USER_ERROR
    except click.ClickException as error:
        code = _fail(f"{error.format_message()}{_hint(error)}", ExitCode.USER_ERROR)
    except ConeflatError as error:
        code = _fail(str(error), ExitCode.USER_ERROR)
    except (KeyboardInterrupt, click.exceptions.Abort):
        code = _fail_interrupted(received)
    except OSError as error:
        # Errors of files are raised as ConeflatError, so this one is from the terminal, a full device, or a pipe whose
        # reader has ended as in `coneflat ... | head`. The shutdown must not print another error.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = ExitCode.INTERNAL_ERROR
        if not isinstance(error, BrokenPipeError):
            _fail(f"cannot print: {error.strerror or error}", code)
    except MemoryError:
        code = _fail("not enough memory for this mesh", ExitCode.INTERNAL_ERROR)
    except Exception as error:
        if os.environ.get("CONEFLAT_DEBUG"):
            raise
        # An interrupt inside a compiled function arrives as another error, which it may or may not have as its cause.
        if received or isinstance(error.__cause__ or error.__context__, KeyboardInterrupt):
            code = _fail_interrupted(received)
        else:
            code = _fail(
                f"internal error, please report it: {type(error).__name__}: {error} "
                "(CONEFLAT_DEBUG=1 shows where)",
                ExitCode.INTERNAL_ERROR,
            )
    # At exit, Python collects garbage among all objects three times: a tenth of the time of a short run.
    gc.freeze()
    sys.exit(code if isinstance(code, int) else 0)


def _open_streams() -> None:
    """Connect closed standard streams to the null device, and what libraries print on standard output.

    No other file gets the descriptors of closed streams then, and a result on standard output stays whole.
    """
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(descriptor)
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115
    is_replaced = sys.stdout is not sys.__stdout__  # By a test.
    if not is_replaced and not (os.name == "nt" and sys.stdout.isatty()):
        own = os.dup(1)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        sys.stdout = open(own, "w", encoding=sys.stdout.encoding, errors=sys.stdout.errors)  # noqa: SIM115


def _fail_interrupted(received: list[int]) -> int:
    # Without a signal that was received, it was SIGINT.
    return _fail("interrupted; no incomplete file was left", ExitCode.SIGNALLED + (received or [2])[0])


def _fail(message: str, code: int) -> int:
    click.echo(f"coneflat: error: {' '.join(message.split())}", err=True)
    return code


def _hint(error: click.ClickException) -> str:
    context = getattr(error, "ctx", None)
    return f" (see `{context.command_path} --help`)" if context is not None else ""
