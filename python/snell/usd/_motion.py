"""Motion: transforms that change over time, and the objects below them."""

from __future__ import annotations

import math
from typing import Any

from pxr import Usd, UsdGeom

__all__ = ["Motion"]

#: Maximum number of times at which a transform is sampled.
_MOST = 4000


class Motion:
    """A joint for each node of the tree, and a channel for each whose transform changes."""

    def __init__(self, stage: Any) -> None:
        rate = float(stage.GetTimeCodesPerSecond())
        #: Time codes per second.
        self.rate = rate if rate > 0 and math.isfinite(rate) else 24.0
        self.joints: list[dict[str, Any]] = []
        self.channels: list[dict[str, Any]] = []
        #: Pairs of a camera or light and its joint.
        self.cameras: list[tuple[int, int]] = []
        self.lights: list[tuple[int, int]] = []

    def add_joint(self, name: str, parent: int | None, node: int, transform: Any) -> int:
        """Adds a joint at a node and returns its number."""
        joint = {"name": name, "node": node, "rest": {"matrix": transform}}
        if parent is not None:
            joint["parent"] = parent
        self.joints.append(joint)
        return len(self.joints) - 1

    def follow(self, prim: Any, joint: int, rows: Any) -> None:
        """Adds the channel of a prim, if its transform changes. Between the samples of a rotation
        the transform is not linear, so the channel also has a key at each whole time code between
        the first and the last sample.
        """
        xformable = UsdGeom.Xformable(prim)
        samples = xformable.GetTimeSamples() if xformable else []
        if len(samples) < 2:
            return
        between = (
            range(int(samples[0]) + 1, int(samples[-1]) + 1)
            if samples[-1] - samples[0] < _MOST
            else []
        )
        times = sorted({*samples, *map(float, between)})
        times = times[:: -(-len(times) // _MOST)]
        keys = []
        for time in times:
            matrix = xformable.GetLocalTransformation(Usd.TimeCode(time))
            keys.append([time / self.rate, rows(matrix)])
        if any(key[1] != keys[0][1] for key in keys):
            self.channels.append({"joint": joint, "track": {"transform": keys}})

    def form(self) -> dict[str, Any]:
        """The motion in the syntax of the document; empty if nothing moves."""
        if not self.channels:
            return {}
        clips = [{"channels": self.channels}]
        return {
            "motion": {
                "joints": self.joints,
                "clips": clips,
                "cameras": self.cameras,
                "lights": self.lights,
            }
        }
