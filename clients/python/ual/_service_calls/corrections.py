"""The calls of `ual.interface.Corrections`. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from ual._calls import Call, of
from ual.corrections import CorrectionsStatus
from ual.v1 import corrections_pb2 as pb
from ual.wire import corrections as wire


def status() -> Call[CorrectionsStatus]:
    return of(
        "GetCorrectionsStatus",
        pb.GetCorrectionsStatusRequest(),
        lambda response: wire.corrections_status_from_proto(response.status),
    )
