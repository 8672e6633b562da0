"""Extensions: a package adds a service of its own to the daemon: docs/how-to/write-an-extension.md."""

from __future__ import annotations

from ual_daemon.extensions.base import Extension, ExtensionContext, lease_of

__all__ = ["Extension", "ExtensionContext", "lease_of"]
