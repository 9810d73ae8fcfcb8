"""The node's report on its frames, for /diagnostics."""
from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass, field
from threading import Lock
import time
from typing import Callable

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
import numpy as np

# A camera counts as silent after PATIENCE s and PERIODS of its own periods without a frame.  Two
# reports pass in PATIENCE, because one may come early; with two periods, a camera of 1 Hz that
# skips one frame would cause a warning.
PATIENCE, PERIODS = 2.0, 3
RECENT = 9  # periods whose median is the camera's: up to four of them may be gaps


@dataclass
class Window:
    """Events between two reports; times in s."""

    begin: float
    arrived: int = 0
    lost: int = 0
    dropped: int = 0
    bad: Counter[str] = field(default_factory=Counter)
    latencies: list[float] = field(default_factory=list)
    ages: list[float] = field(default_factory=list)
    arcs: list[int] = field(default_factory=list)


class Statistics:
    """Counts of frames by outcome; every method may be called from any thread."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Take a monotonic clock, a function that returns a time in s."""
        self._lock = Lock()
        self._clock = clock
        self._window = Window(clock())
        self._quiet_since = self._window.begin
        self._previous: float | None = None  # arrival of the last frame, while subscribed
        self._periods: deque[float] = deque(maxlen=RECENT)
        self._frames = self._lost = self._dropped = 0
        self._bad: Counter[str] = Counter()

    def arrived(self) -> None:
        """Count a frame that arrived."""
        with self._lock:
            self._window.arrived += 1
            now = self._clock()
            if self._previous is not None:
                self._periods.append(now - self._previous)
            self._previous = self._quiet_since = now

    def lost(self, count: int) -> None:
        """Count frames that the middleware lost on their way here."""
        with self._lock:
            self._window.lost += count
            self._lost += count

    def dropped(self) -> None:
        """Count a frame that a newer one replaced before it was processed."""
        with self._lock:
            self._window.dropped += 1
            self._dropped += 1

    def bad(self, reason: str) -> None:
        """Count a bad frame by the phrase of its reason."""
        with self._lock:
            self._window.bad[reason] += 1
            self._bad[reason] += 1

    def done(self, latency: float, age: float, arcs: int) -> None:
        """
        Count a frame whose results have been published.

        ``latency`` is the time in s since its arrival, ``age`` the time in s since its stamp,
        ``arcs`` its number of arcs.
        """
        with self._lock:
            self._frames += 1
            self._window.latencies.append(latency)
            self._window.ages.append(age)
            self._window.arcs.append(arcs)

    def report(self, status: DiagnosticStatus, listening: bool, max_age: float) -> None:
        """
        Fill in level, message and values of a status for the time since the last report.

        ``listening`` is whether the node subscribes to frames.  A median age above ``max_age`` s
        causes a warning, unless ``max_age`` is 0.
        """
        with self._lock:
            now = self._clock()
            window, self._window = self._window, Window(now)
            warnings = self._silence(now, listening)
            bad = self._bad.copy()
            totals = {'frames': self._frames, 'frames lost': self._lost,
                      'frames dropped': self._dropped, 'frames bad': sum(bad.values())}
        if listening:
            warnings += _warnings(window, max_age)
        status.level = DiagnosticStatus.WARN if warnings else DiagnosticStatus.OK
        status.message = '; '.join(warnings) or ('detecting' if listening else 'nobody listens')
        values = _values(window, now - window.begin) | totals
        values |= {f'frames bad: {reason}': count for reason, count in sorted(bad.items())}
        status.values += [KeyValue(key=key, value=str(value)) for key, value in values.items()]

    def _silence(self, now: float, listening: bool) -> list[str]:
        """Return a warning if the camera has been silent for longer than usual, in a list."""
        if not listening:
            self._previous, self._quiet_since = None, now
        silence = now - self._quiet_since
        patience = max(PATIENCE, PERIODS * float(np.median(self._periods or [0])))
        return [f'no frame came in for {silence:.1f} s'] if silence > patience else []


def _warnings(window: Window, max_age: float) -> list[str]:
    """Return the warnings on the frames of a window."""
    warnings = []
    if window.bad:
        reasons = ', '.join(sorted(window.bad))
        warnings.append(f'{sum(window.bad.values())} bad frames ({reasons})')
    if window.lost:
        warnings.append(f'{window.lost} frames lost by the middleware, see config/fastdds.xml')
    if window.dropped:
        warnings.append(f'{window.dropped} of {window.arrived} frames dropped')
    if max_age and window.ages and np.median(window.ages) > max_age:
        warnings.append(f'late: median age is {np.median(window.ages):.3g} s, '
                        f'max_age {max_age:.3g} s')
    return warnings


def _values(window: Window, duration: float) -> dict[str, str]:
    """Return rates, times and number of arcs in a window of a duration in s."""
    period = max(duration, 1e-9)
    return {
        'rate in (Hz)': f'{window.arrived / period:.1f}',
        'rate out (Hz)': f'{len(window.ages) / period:.1f}',
        'latency median (ms)': _milliseconds(window.latencies, 50),
        'latency p95 (ms)': _milliseconds(window.latencies, 95),
        'age median (ms)': _milliseconds(window.ages, 50),
        'age p95 (ms)': _milliseconds(window.ages, 95),
        'arcs per frame': f'{np.mean(window.arcs):.1f}' if window.arcs else 'nan',
    }


def _milliseconds(times: list[float], percentile: float) -> str:
    return f'{1000 * np.percentile(times, percentile):.1f}' if times else 'nan'
