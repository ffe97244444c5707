"""The direction of the sun, and skies with it."""

from __future__ import annotations

import datetime

import numpy as np
import pytest

import snell

UTC = datetime.timezone.utc


def angles(towards: np.ndarray) -> tuple[float, float]:
    """Elevation and azimuth in degrees, for z up."""
    return (
        float(np.degrees(np.arcsin(towards[2]))),
        float(np.degrees(np.arctan2(towards[0], towards[1])) % 360),
    )


def test_published_positions():
    """The example of Reda and Andreas, Solar Position Algorithm for Solar Radiation Applications
    (NREL, 2003), whose result is exact to 0.0003 degrees.
    """
    zone = datetime.timezone(datetime.timedelta(hours=-7))
    when = datetime.datetime(2003, 10, 17, 12, 30, 30, tzinfo=zone)
    elevation, azimuth = angles(snell.sun_direction(39.742476, -105.1786, when, up="z"))
    assert abs(elevation - 39.872046) < 0.005 and abs(azimuth - 194.340241) < 0.01
    seen = angles(snell.sun_direction(39.742476, -105.1786, when, up="z", refraction=True))[0]
    assert abs(seen - (90 - 50.111622)) < 0.01


def test_solstices_and_equinoxes():
    """Declinations at the instants of the seasons of 2024 (UTC, to the minute, by the Astronomical
    Almanac): the tropics and the equator have the sun in the zenith then.
    """
    for when, declination in [
        (datetime.datetime(2024, 3, 20, 3, 6), 0),
        (datetime.datetime(2024, 6, 20, 20, 51), 23.4385),
        (datetime.datetime(2024, 9, 22, 12, 44), 0),
        (datetime.datetime(2024, 12, 21, 9, 20), -23.4385),
    ]:
        pole = snell.sun_direction(90, 0, when, up="z")
        assert abs(np.degrees(np.arcsin(pole[2])) - declination) < 0.01


def test_axes_times_and_shapes():
    when = datetime.datetime(2024, 5, 4, 15, 30, tzinfo=UTC)
    z_up = snell.sun_direction(48.8, 2.3, when, up="z")
    east, north, above = z_up
    assert east < 0 and north < 0 and above > 0  # An afternoon in the north.
    assert np.allclose(snell.sun_direction(48.8, 2.3, when), [east, above, -north])
    assert np.allclose(
        snell.sun_direction(48.8, 2.3, when, up="z", north="x"), [north, -east, above]
    )
    assert np.allclose(snell.sun_direction(48.8, 2.3, when, up=(0, 0, 9)), z_up)
    zone = datetime.timezone(datetime.timedelta(hours=2))
    assert np.allclose(snell.sun_direction(48.8, 2.3, when.astimezone(zone), up="z"), z_up)
    naive = when.replace(tzinfo=None)
    assert np.allclose(snell.sun_direction(48.8, 2.3, naive, up="z"), z_up)
    hours = np.datetime64("2024-05-04T00") + np.arange(24).astype("m8[h]")
    day = snell.sun_direction([[48.8], [-33.9]], [[2.3], [151.2]], hours, up="z")
    assert day.shape == (2, 24, 3) and np.allclose(np.linalg.norm(day, axis=-1), 1)
    assert np.allclose(day[0, 12], snell.sun_direction(48.8, 2.3, hours[12], up="z"))
    many = snell.sun_direction(48.8, 2.3, [naive, when], up="z")
    assert np.allclose(many, z_up)


def test_bad_arguments():
    when = datetime.datetime(2024, 5, 4)
    for arguments, keywords, message in [
        ((91, 0, when), {}, "latitude is 91"),
        ((0, np.nan, when), {}, "longitude is nan"),
        ((0, 0, np.datetime64("NaT")), {}, "NaT"),
        ((0, 0, when), {"up": "u"}, "up is 'u'"),
        ((0, 0, when), {"up": (0, 0, 0)}, r"up is \(0, 0, 0\)"),
        ((0, 0, when), {"up": "z", "north": "-z"}, "north is '-z'"),
    ]:
        with pytest.raises(ValueError, match=message):
            snell.sun_direction(*arguments, **keywords)
    for when in ("noon", 3, datetime.date(2024, 1, 1)):
        with pytest.raises(TypeError, match="when"):
            snell.sun_direction(0, 0, when)


@pytest.mark.parametrize("up", ["y", "z"])
def test_the_sky_has_its_sun_there(up):
    scene = snell.Scene()
    scene.up = up
    sun = snell.sun_direction(48.8, 2.3, np.datetime64("2024-06-20T09:00"), up=up)
    scene.set_sky(sun)
    seen = []
    for towards in (sun, sun * [-1, 1, -1] if up == "y" else sun * [-1, -1, 1], -sun):
        camera = snell.Camera(eye=(0, 0, 0), towards=towards, up=(0.1, 0.9, 0.3), fov=4)
        picture = snell.render(scene, "path", camera=camera, spp=4, size=(8, 8), progress=False)
        seen.append(np.asarray(picture).max())
    assert seen[0] > 1000 * seen[1] > 0 and seen[2] < seen[1]
    with pytest.raises(ValueError, match="below the horizon"):
        scene.set_sky(-sun)
    with pytest.raises(ValueError, match="turbidity is 20, expected 1 to 10"):
        scene.set_sky(sun, turbidity=20)
    with pytest.raises(ValueError, match="size is 30"):
        scene.set_sky(sun, size=30)
