"""What the node tells about itself on /diagnostics."""
from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from threading import Lock
import time

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
import numpy as np


@dataclass
class Window:
    """What happened between two reports; times in s."""

    begin: float = field(default_factory=time.monotonic)
    arrived: int = 0
    lost: int = 0
    dropped: int = 0
    bad: Counter[str] = field(default_factory=Counter)
    latencies: list[float] = field(default_factory=list)
    ages: list[float] = field(default_factory=list)
    arcs: list[int] = field(default_factory=list)


class Statistics:
    """Counts of what happened to the frames; every method may be called from any thread."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._window = Window()
        self._frames = self._lost = self._dropped = 0
        self._bad: Counter[str] = Counter()

    def arrived(self) -> None:
        """Count a frame that came in."""
        with self._lock:
            self._window.arrived += 1

    def lost(self, count: int) -> None:
        """Count frames that the middleware lost on their way here."""
        with self._lock:
            self._window.lost += count
            self._lost += count

    def dropped(self) -> None:
        """Count a frame that a newer one replaced before its turn."""
        with self._lock:
            self._window.dropped += 1
            self._dropped += 1

    def bad(self, reason: str) -> None:
        """Count a frame that could not be used."""
        with self._lock:
            self._window.bad[reason] += 1
            self._bad[reason] += 1

    def done(self, latency: float, age: float, arcs: int) -> None:
        """
        Count a frame whose results are out.

        ``latency`` is the time in s since it came in, ``age`` that since its stamp, ``arcs`` the
        number of arcs in it.
        """
        with self._lock:
            self._frames += 1
            self._window.latencies.append(latency)
            self._window.ages.append(age)
            self._window.arcs.append(arcs)

    def report(self, status: DiagnosticStatus, listening: bool, max_age: float) -> None:
        """
        Fill in level, message and values of a status, for the time since the last report.

        ``listening`` tells whether frames are asked for; a median age above ``max_age`` s is a
        reason to warn, unless it is 0.
        """
        with self._lock:
            window, self._window = self._window, Window()
            bad = self._bad.copy()
            totals = {'frames': self._frames, 'frames lost': self._lost,
                      'frames dropped': self._dropped, 'frames bad': sum(bad.values())}
        warnings = _warnings(window, max_age) if listening else []
        status.level = DiagnosticStatus.WARN if warnings else DiagnosticStatus.OK
        status.message = '; '.join(warnings) or ('detecting' if listening else 'nobody listens')
        values = _values(window) | totals
        values |= {f'frames bad: {reason}': count for reason, count in sorted(bad.items())}
        status.values += [KeyValue(key=key, value=str(value)) for key, value in values.items()]


def _warnings(window: Window, max_age: float) -> list[str]:
    warnings = []
    if not window.arrived:
        warnings.append('no frame came in')
    if window.bad:
        reasons = ', '.join(sorted(window.bad))
        warnings.append(f'{sum(window.bad.values())} bad frames ({reasons})')
    if window.lost:
        warnings.append(f'{window.lost} frames lost on the way here, see config/fastdds.xml')
    if window.dropped:
        warnings.append(f'{window.dropped} of {window.arrived} frames dropped')
    if max_age and window.ages and np.median(window.ages) > max_age:
        warnings.append(f'late: median age is {np.median(window.ages):.3g} s, '
                        f'max_age {max_age:.3g} s')
    return warnings


def _values(window: Window) -> dict[str, str]:
    period = max(time.monotonic() - window.begin, 1e-9)
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
