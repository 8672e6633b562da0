"""Futures in turn: what follows from a result, where the one before ends. No thread waits."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future
from threading import Lock
from typing import Any, TypeVar

S = TypeVar("S")
T = TypeVar("T")


def done(result: T) -> Future[T]:
    """Returns a future that has ended well."""
    future: Future[T] = Future()
    future.set_result(result)
    return future


def then(first: Future[S], step: Callable[[S], T]) -> Future[T]:
    """Returns the future of what a step makes of a result, where the first one ends. Cancelling it cancels that."""
    return then_wait(first, lambda result: done(step(result)))


def then_wait(first: Future[S], step: Callable[[S], Future[T]]) -> Future[T]:
    """As `then`, for a step that has a future itself. A step that raises ends the result with its error."""
    result: Future[T] = Future()
    running: list[Future[S] | Future[T]] = [first]

    def on_first(done: Future[S]) -> None:
        if done.cancelled() or result.cancelled():
            result.cancel()
            return
        try:
            last = step(done.result())
        except Exception as error:  # noqa: BLE001  whatever it is, who waits for the result has to get it
            last = Future()
            last.set_exception(error)
        running.append(last)
        if result.cancelled():  # while the step began it, so that `on_result` did not see it
            last.cancel()
        last.add_done_callback(lambda ended: _end_as(ended, result))

    def on_result(ended: Future[T]) -> None:
        if ended.cancelled():
            for each in running:
                each.cancel()

    result.add_done_callback(on_result)
    first.add_done_callback(on_first)
    return result


def shared(first: Future[T]) -> Future[T]:
    """Returns a future that ends as another one, for one of several waiters: cancelling it leaves that one."""
    result: Future[T] = Future()
    first.add_done_callback(lambda ended: _end_as(ended, result))
    return result


def pass_on(source: Future[T], target: Future[T]) -> None:
    """Ends a future as another one ends. Cancelling it cancels that one."""
    target.add_done_callback(lambda ended: source.cancel() if ended.cancelled() else None)
    source.add_done_callback(lambda ended: _end_as(ended, target))


def caught(first: Future[T], step: Callable[[BaseException], Future[T]]) -> Future[T]:
    """Returns the future of a result, or of what a step makes of the error. Cancelling it cancels that."""
    settled: Future[Future[T]] = Future()

    def on_first(ended: Future[T]) -> None:
        if ended.cancelled():
            settled.cancel()
        elif settled.set_running_or_notify_cancel():
            settled.set_result(ended)

    settled.add_done_callback(lambda ended: first.cancel() if ended.cancelled() else None)
    first.add_done_callback(on_first)

    def follow(ended: Future[T]) -> Future[T]:
        error = ended.exception()
        return ended if error is None else step(error)

    return then_wait(settled, follow)


def in_turn(first: Callable[[], Future[Any]], *steps: Callable[[], Future[Any]]) -> Future[Any]:
    """Returns the future of the last of some steps, each begun where the one before has ended well."""
    future = first()
    for step in steps:
        future = then_wait(future, lambda _, begin=step: begin())  # type: ignore[misc]  # of a default
    return future


def together(some: Iterable[Future[T]]) -> Future[tuple[T, ...]]:
    """Returns the future of all results, where the last one ends. Cancelling it cancels all that have not ended."""
    waited = list(some)
    result: Future[tuple[T, ...]] = Future()
    left, lock = [len(waited)], Lock()

    def on_end(_: object) -> None:
        with lock:
            left[0] -= 1
            is_last = not left[0]
        if is_last:
            _gather(waited, result)

    result.add_done_callback(lambda ended: [each.cancel() for each in waited] if ended.cancelled() else None)
    for each in waited:
        each.add_done_callback(on_end)
    if not waited:
        result.set_result(())
    return result


def _gather(ended: Sequence[Future[T]], result: Future[tuple[T, ...]]) -> None:
    if any(each.cancelled() for each in ended):
        result.cancel()
    elif result.set_running_or_notify_cancel():
        error = next(filter(None, (each.exception() for each in ended)), None)
        if error is None:
            result.set_result(tuple(each.result() for each in ended))
        else:
            result.set_exception(error)


def _end_as(source: Future[T], target: Future[T]) -> None:
    if source.cancelled():
        target.cancel()
        return
    if target.done() or not target.set_running_or_notify_cancel():
        return
    error = source.exception()
    if error is None:
        target.set_result(source.result())
    else:
        target.set_exception(error)
