"""MAVLink as bytes: frames, checksums, signatures, messages."""
