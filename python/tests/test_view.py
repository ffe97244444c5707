"""The viewer, and explanations of pixels."""

from __future__ import annotations

import urllib.error
import urllib.request

import numpy as np
import pytest
import snell


def test_a_pixel_is_the_mean_of_its_samples_and_these_the_sums_of_their_paths() -> None:
    options = {"spp": 9, "size": (24, 18)}
    image = np.asarray(snell.render("cornell-box", progress=False, **options))
    told = snell.explain("cornell-box", (7, 11), structures=["bvh", "grid"], **options)
    assert tuple(np.float32(told["value"][:3])) == tuple(image[11, 7])
    assert np.allclose(np.mean(told["samples"], axis=0), image[11, 7], rtol=1e-5)
    assert told["tree"]["sum"] == told["tree"]["color"] == told["samples"][told["tree"]["number"]]
    assert [journey["accelerator"] for journey in told["journeys"]] == ["bvh", "grid"]


def test_what_cannot_be_explained_is_said() -> None:
    with pytest.raises(ValueError, match="24x18"):
        snell.explain("cornell-box", (24, 0), size=(24, 18), spp=1)
    with pytest.raises(ValueError, match="bvh"):
        snell.explain("cornell-box", (0, 0), size=(24, 18), spp=1, structures=["tree"])


def test_a_view_answers_until_it_is_closed_and_only_with_its_token() -> None:
    scene = snell.Scene()
    scene.add_shape("sphere", radius=1)
    with snell.view(scene, spp=1, open=False) as view:
        assert b"<!doctype html>" in urllib.request.urlopen(view.url).read().lower()
        with pytest.raises(urllib.error.HTTPError):
            urllib.request.urlopen("/".join(view.url.split("/")[:3]) + "/")
        assert view.url in view._repr_html_() and view.is_open
    assert not view.is_open and "closed" in repr(view)
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(view.url)
