"""Gives recorded samples the namespace under which they are replayed."""

from __future__ import annotations

from dataclasses import replace

from ual.types import Frame, Telemetry


def renamed(sample: Telemetry, old: str, new: str) -> Telemetry:
    """Returns a sample whose frames are those of another namespace."""
    if old == new:
        return sample

    def name(frame_id: str) -> str:
        return _name(frame_id, old, new)

    body, transform = sample.odometry, sample.transform
    return replace(
        sample,
        frame_id=name(sample.frame_id),
        odometry=None
        if body is None
        else replace(body, frame_id=name(body.frame_id), child_frame_id=name(body.child_frame_id)),
        transform=None
        if transform is None
        else replace(transform, frame_id=name(transform.frame_id), child_frame_id=name(transform.child_frame_id)),
    )


def renamed_frame(frame: Frame, old: str, new: str) -> Frame:
    """Returns a frame with its names, and that of its parent, in another namespace."""
    return replace(
        frame,
        frame_id=_name(frame.frame_id, old, new),
        parent_frame_id=_name(frame.parent_frame_id, old, new),
    )


def _name(frame_id: str, old: str, new: str) -> str:
    return f"{new}/{frame_id.removeprefix(f'{old}/')}" if frame_id.startswith(f"{old}/") else frame_id
