"""Encoding of a parameter's value in the four bytes that PARAM_VALUE and PARAM_SET have for it.

https://mavlink.io/en/services/parameter.html#parameter-encoding. The field is a float. PX4 puts the bytes of an integer
there, ArduPilot the number.
"""

from __future__ import annotations

import math
import struct
from abc import ABC, abstractmethod

from typing_extensions import override

from ual.errors import InvalidArgumentError
from ual.parameters.values import Parameter, ParameterType, real32

_TYPES = {each.value: each for each in ParameterType}
_FORMATS = {
    ParameterType.UINT8: "<B3x",
    ParameterType.INT8: "<b3x",
    ParameterType.UINT16: "<H2x",
    ParameterType.INT16: "<h2x",
    ParameterType.UINT32: "<I",
    ParameterType.INT32: "<i",
    ParameterType.REAL32: "<f",
}


class ParameterCodec(ABC):
    """One of the two ways."""

    def decode(self, field: float, type_number: int, came: bytes = b"") -> tuple[float, ParameterType] | None:
        """Returns the value and the type; None for a type that UAL does not know, or a value that it cannot have.

        `came` are the field's bytes, where they came: as a float some integers change (a signalling NaN).
        """
        kind = _TYPES.get(type_number)
        if kind is None:
            return None
        value = self._value(field, kind, came)
        least, largest = kind.limits
        return None if kind.is_whole and not least <= value <= largest else (value, kind)

    def encode(self, parameter: Parameter) -> float:
        """Returns the field.

        Raises:
            InvalidArgumentError: The type does not have this value, or the field cannot have exactly it.

        """
        least, largest = parameter.type.limits
        if not least <= parameter.value <= largest:  # NaN, too
            text = f"value: {parameter.value:g} does not fit {parameter.type.name}"
            raise InvalidArgumentError(text, {"field": "value"})
        field = self._field(parameter.value, parameter.type)
        decoded = self.decode(field, parameter.type.value)
        if decoded is None or decoded[0] != parameter.value:
            raise InvalidArgumentError(
                f"value: MAVLink cannot send {parameter.value:.15g} to this autopilot exactly", {"field": "value"}
            )
        return field

    @abstractmethod
    def _value(self, field: float, kind: ParameterType, came: bytes) -> float: ...

    @abstractmethod
    def _field(self, value: float, kind: ParameterType) -> float: ...


class ByteWise(ParameterCodec):
    """PX4: the bytes of the value. Some integers below -4,194,304 look like a signalling NaN, and cannot be sent."""

    @override
    def _value(self, field: float, kind: ParameterType, came: bytes) -> float:
        value: float = struct.unpack(_FORMATS[kind], came or struct.pack("<f", field))[0]
        return value

    @override
    def _field(self, value: float, kind: ParameterType) -> float:
        field: float = struct.unpack("<f", struct.pack(_FORMATS[kind], int(value) if kind.is_whole else value))[0]
        return field


class Cast(ParameterCodec):
    """ArduPilot: the number. Integers beyond 2^24 cannot all be sent."""

    @override
    def _value(self, field: float, kind: ParameterType, came: bytes) -> float:
        return int(field) if kind.is_whole and math.isfinite(field) else field

    @override
    def _field(self, value: float, kind: ParameterType) -> float:
        return real32(value)
