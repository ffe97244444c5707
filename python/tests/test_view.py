"""The viewer, and explanations of pixels."""

from __future__ import annotations

import urllib.error
import urllib.request
import webbrowser

import numpy as np
import pytest

import snell


def test_a_scene_has_a_picture_in_notebooks():
    scene = snell.Scene()
    assert scene._repr_png_() is None
    scene.add_shape("sphere", radius=1)
    assert scene._repr_png_()[:4] == b"\x89PNG"


def test_a_pixel_is_the_mean_of_its_samples_and_these_the_sums_of_their_paths() -> None:
    options = {"spp": 9, "size": (24, 18)}
    image = np.asarray(snell.render("cornell-box", progress=False, **options))
    report = snell.explain("cornell-box", (7, 11), structures=["bvh", "grid"], **options)
    assert tuple(np.float32(report["value"][:3])) == tuple(image[11, 7])
    assert np.allclose(np.mean(report["samples"], axis=0), image[11, 7], rtol=1e-5)
    assert (
        report["tree"]["sum"]
        == report["tree"]["color"]
        == report["samples"][report["tree"]["number"]]
    )
    assert [trace["accelerator"] for trace in report["traces"]] == ["bvh", "grid"]


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


def test_the_command_line_of_the_browser_has_no_token(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    with snell.view("cornell-box", spp=1, size=(16, 12), open=True) as view:
        token = view.url.split("/")[3]
        assert len(opened) == 1 and token not in opened[0]
        with urllib.request.urlopen(opened[0]) as page:
            assert page.url == view.url
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(opened[0])


def test_a_dropped_file_names_no_file_of_the_machine() -> None:
    with snell.view("cornell-box", spp=1, size=(16, 12), open=False) as view:
        for name in ["/etc/passwd", "../../../../../etc/passwd"]:
            text = f"mtllib {name}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
            with pytest.raises(urllib.error.HTTPError, match="422") as refused:
                urllib.request.urlopen(view.url + "open?name=a.obj", data=text.encode())
            assert "drop it together with the files" in refused.value.read().decode()


def test_a_rate_that_is_none_is_said() -> None:
    for fps in [0, -1, float("nan"), float("inf")]:
        with pytest.raises(ValueError, match="fps"):
            snell.view("cornell-box", fps=fps, open=False)
