"""What values of the contract do beside holding their fields: ``XBase`` is a base of the value ``X``."""

from __future__ import annotations
