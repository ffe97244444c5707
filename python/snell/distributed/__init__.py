"""Pictures that many machines render together, on Dask or on Ray.

A picture is cut into tasks: some samples of some tiles. The workers of a cluster perform them in
any order, and the results are merged to the same bits that :func:`snell.render` gives. A worker may
stop at any time; what it was doing is done again by another.

Examples
--------
>>> import numpy as np, snell, snell.distributed
>>> small = {"spp": 4, "size": (32, 24)}
>>> image = snell.distributed.render("cornell-box", **small)  # doctest: +SKIP
>>> bool((np.asarray(image) == snell.render("cornell-box", **small)).all())  # doctest: +SKIP
True
"""

from snell.distributed._render import Rendering, render, render_frames, render_iter, start

__all__ = ["Rendering", "render", "render_frames", "render_iter", "start"]
