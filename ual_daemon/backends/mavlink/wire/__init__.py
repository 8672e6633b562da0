"""MAVLink as bytes: frames, checksums, signatures and messages, received and sent through a link."""
