"""The program's output, which may be closed, on a full disk, or go to a reader that has left."""

from __future__ import annotations

import contextlib
import errno
import io
import os
import sys
from enum import Enum

import click
from typing_extensions import override

_STDERR_DESCRIPTOR = 2


class OutputLostError(OSError):
    """Output that did not arrive; `has_reader_left` where the other end of a pipe was closed."""

    def __init__(self, error: OSError) -> None:
        super().__init__(error.errno, error.strerror)
        self.has_reader_left = error.errno == errno.EPIPE

    @override
    def __str__(self) -> str:
        return str(self.strerror)


class OutputKind(Enum):
    """Kind of a line, and so the meaning of its loss."""

    MESSAGE = "for people, on standard error"
    DONE = "what was done, which no lost line makes undone"
    RESULT = "what was asked for"


def write(text: str, kind: OutputKind) -> None:
    """Prints a line.

    Raises:
        OutputLostError: A `OutputKind.RESULT` cannot be printed.

    """
    try:
        click.echo(text, err=kind is OutputKind.MESSAGE)
    except OutputLostError as error:
        if kind is OutputKind.RESULT:
            raise
        give_up_output()
        click.echo(f"ual: done, but the result cannot be printed: {error}", err=True)


class _Output(io.TextIOWrapper):
    """Standard output. Says by an error of its own that it cannot be written, so that no one takes it for another."""

    @override
    def write(self, text: str, /) -> int:
        try:
            return super().write(text)
        except OSError as error:
            raise OutputLostError(error) from error

    @override
    def flush(self) -> None:
        try:
            super().flush()
        except OSError as error:
            raise OutputLostError(error) from error


class _Messages(io.TextIOWrapper):
    """Standard error. Where it cannot be written there is no place left to say so: the exit status tells."""

    @override
    def write(self, text: str, /) -> int:
        with contextlib.suppress(OSError):
            return super().write(text)
        return len(text)

    @override
    def flush(self) -> None:
        with contextlib.suppress(OSError):
            super().flush()


def prepare() -> None:
    """Makes the streams of a program usable, however it was started. Called once, before anything is opened.

    A stream that was closed leads to the null device; else the next file or socket would get its number, and what is
    printed.
    """
    while (number := os.open(os.devnull, os.O_RDWR)) <= _STDERR_DESCRIPTOR:
        os.set_inheritable(number, True)
    os.close(number)
    sys.stdout = _rewrapped(_Output, sys.stdout, 1)
    sys.stderr = _rewrapped(_Messages, sys.stderr, _STDERR_DESCRIPTOR)


def end_without_output(error: OutputLostError) -> bool:
    """Gives the output up, and says so. Returns whether that is fine: its reader wanted no more."""
    give_up_output()
    if not error.has_reader_left:
        click.echo(f"ual: the result cannot be printed: {error}", err=True)
    return error.has_reader_left


def give_up_output() -> None:
    """Leads standard output to the null device: Python must not flush into the lost one at exit."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, sys.stdout.fileno())
    os.close(null)


def _rewrapped(kind: type[io.TextIOWrapper], stream: object, number: int) -> io.TextIOWrapper:
    """Returns a stream of another kind over the bytes of one; one of its own where there was none."""
    if not isinstance(stream, io.TextIOWrapper):
        return kind(open(number, "wb", closefd=False), encoding="utf-8", errors="backslashreplace")
    line_buffering, encoding, errors = stream.line_buffering, stream.encoding, stream.errors
    if errors == "strict":  # pipes of Windows are in its old encodings: a sign that they lack must not end a flight
        errors = "backslashreplace"
    return kind(stream.detach(), encoding=encoding, errors=errors, line_buffering=line_buffering)
