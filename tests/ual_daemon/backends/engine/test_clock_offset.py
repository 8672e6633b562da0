import random
from collections.abc import Callable

from ual_daemon.backends.engine.clock_offset import ClockOffset

UTC_S = 1.8e9


def run(
    stamps: ClockOffset,
    *,
    from_s: float,
    to_s: float,
    delay: Callable[[], float],
    drift: float = 0.0,
    rate_hz: float = 50.0,
    utc_step_s: float = 0.0,
) -> list[float]:
    """Errors of the stamps of messages measured at monotonic times, sent with a delay; the autopilot booted at -100."""
    errors = []
    count = int((to_s - from_s) * rate_hz)
    for i in range(count):
        measured_s = from_s + i / rate_hz
        received_s = measured_s + delay()
        boot_s = (measured_s + 100.0) * (1.0 - drift)
        utc = stamps.to_utc(boot_s, received_s, UTC_S + utc_step_s + received_s)
        errors.append(utc - (UTC_S + utc_step_s + measured_s))
    return errors


def test_jitter_of_the_link_is_taken_out() -> None:
    jitter = random.Random(1)
    errors = run(ClockOffset(), from_s=0.0, to_s=20.0, delay=lambda: 0.002 + jitter.expovariate(1 / 0.01))
    settled = errors[50:]
    assert max(settled) - min(settled) < 0.006
    assert 0.0015 < sum(settled) / len(settled) < 0.006  # the fastest message's delay remains


def test_a_clock_that_runs_one_percent_slow_is_followed() -> None:
    errors = run(ClockOffset(), from_s=0.0, to_s=60.0, delay=lambda: 0.001, drift=0.01)
    assert max(abs(error) for error in errors) < 0.012


def test_a_step_of_the_wall_clock_moves_the_stamps_with_it() -> None:
    stamps = ClockOffset()
    run(stamps, from_s=0.0, to_s=2.0, delay=lambda: 0.001)
    errors = run(stamps, from_s=2.0, to_s=3.0, delay=lambda: 0.001, utc_step_s=-3600.0)
    assert max(abs(error) for error in errors) < 0.002


def test_a_late_message_is_stamped_when_it_was_measured() -> None:
    stamps = ClockOffset()
    run(stamps, from_s=0.0, to_s=1.0, delay=lambda: 0.001)
    (error,) = run(stamps, from_s=1.0, to_s=1.02, delay=lambda: 0.3)
    assert abs(error) < 0.002
