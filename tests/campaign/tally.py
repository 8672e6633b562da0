"""Tally of the judge's evidence: a campaign that flew nothing breaks no rule either."""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Sequence

from tests.campaign.evidence import Case
from tests.campaign.judge import misses_m
from tests.campaign.motion import asides_m
from tests.campaign.record import Record


def tally(records: Sequence[Record]) -> str:
    """Returns the counts of several flights, as a line."""
    counts: Counter[str] = Counter()
    faults: Counter[str] = Counter()
    missed_m: list[float] = []
    beside_m: list[float] = []
    for record in records:
        case = Case(record)
        counts["flights"] += 1
        counts["setpoints"] += len(case.setpoints_s)
        counts["orders"] += len(record.sent) - len(case.setpoints_s)
        counts["states"] += len(record.said)
        counts["take-overs"] += len(case.taken_s)
        counts["calls"] += len(record.called)
        counts["calls refused or ended"] += sum(bool(call.outcome) for call in record.called)
        faults.update({trouble.kind for trouble in record.troubles})
        missed_m += [missed for _, missed, _ in misses_m(record)]
        beside_m += [worst for _, worst, _ in asides_m(case)]
    text = ", ".join(f"{count} {name}" for name, count in counts.items())
    if missed_m:
        text += f", {len(missed_m)} goals reached, by the truth {statistics.median(missed_m):.2f} m beside (median)"
        text += f", {max(missed_m):.2f} m at most"
    if beside_m:
        text += f", {len(beside_m)} velocities out of a hold, by the truth {statistics.median(beside_m):.2f} m aside"
        text += f" (median), {max(beside_m):.2f} m at most"
    return text + "; flights with " + ", ".join(f"{name} {count}" for name, count in sorted(faults.items()))
