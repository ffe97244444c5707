"""The direction of the sun."""

from __future__ import annotations

import datetime
from typing import Any

import numpy as np

from snell._arrays import array_of
from snell._snell import _upright

# The epoch J2000.0 in UTC, up to the 64 seconds between them and the 32 that atomic time was ahead.
_J2000 = np.datetime64("2000-01-01T12:00:00", "us")
# Terrestrial time minus universal time, in days. It was 64 s in 2000 and is 69 s in 2025; the sun
# moves by 0.0007 degrees in a minute.
_DELTA_T = 69 / 86400


def sun_direction(
    latitude: Any,
    longitude: Any,
    when: Any,
    *,
    up: Any = "y",
    north: Any = None,
    refraction: bool = False,
) -> np.ndarray:
    """The unit vector towards the sun, for a place on Earth and a time.

    It is accurate to 0.005 degrees from 1950 to 2100 (Meeus, Astronomical Algorithms, 2nd edition,
    chapters 12, 13, 22 and 25, and the parallax of the sun). Below the horizon it points down.

    Parameters
    ----------
    latitude, longitude : float or array (...)
        Degrees; north and east are positive. They are broadcast with `when`.
    when : datetime, numpy.datetime64, or array (...) of them
        A `datetime` with a time zone; without one, and for NumPy's times, it is UTC.
    up, north : str or array (3,)
        The directions in the scene that are up and north: ``"x"``, ``"-x"``, ``"y"`` and so on, or
        a vector. North is -z if y is up and +y if z is up, unless it is given; east is then +x.
    refraction : bool
        Whether the air lifts the sun, by half a degree at the horizon, as it is seen. Not by
        default.

    Returns
    -------
    array (..., 3)

    Examples
    --------
    >>> import datetime, snell
    >>> noon = datetime.datetime(2024, 6, 20, 12, 2, tzinfo=datetime.timezone.utc)
    >>> snell.sun_direction(51.4779, 0, noon, up="z").round(3).tolist()  # Greenwich
    [-0.001, -0.47, 0.883]
    """
    east, north, up = _frame(up, north)
    latitude, longitude = (
        _degrees(value, name, limit)
        for value, name, limit in ((latitude, "latitude", 90), (longitude, "longitude", 360))
    )
    days = _days(when)
    latitude, longitude, days = np.broadcast_arrays(latitude, longitude, days)
    right_ascension, declination, sidereal = _apparent(days)
    # Meeus 13.5 and 13.6, with the azimuth from north.
    hour = np.radians(sidereal + longitude) - right_ascension
    phi = np.radians(latitude)
    to_east = -np.cos(declination) * np.sin(hour)
    to_north = np.cos(phi) * np.sin(declination) - np.sin(phi) * np.cos(declination) * np.cos(hour)
    to_up = np.sin(phi) * np.sin(declination) + np.cos(phi) * np.cos(declination) * np.cos(hour)
    level = np.hypot(to_east, to_north)
    # The centre of the Earth sees it higher than its surface does.
    elevation = np.arctan2(to_up, level) - np.radians(8.794 / 3600) * level
    if refraction:
        elevation = elevation + _refraction(elevation)
    scale = np.cos(elevation) / np.maximum(level, 1e-300)
    towards: np.ndarray = (
        np.multiply.outer(to_east * scale, east)
        + np.multiply.outer(to_north * scale, north)
        + np.multiply.outer(np.sin(elevation), up)
    )
    return towards


def _sin(degrees: np.ndarray) -> np.ndarray:
    sine: np.ndarray = np.sin(np.radians(degrees))
    return sine


def _cos(degrees: np.ndarray) -> np.ndarray:
    cosine: np.ndarray = np.cos(np.radians(degrees))
    return cosine


def _apparent(days: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Right ascension and declination of the sun in radians, and the apparent sidereal time at
    Greenwich in degrees, for days since J2000 in universal time.
    """
    t = (days + _DELTA_T) / 36525
    # Chapter 25, the lower accuracy.
    mean_longitude = 280.46646 + t * (36000.76983 + t * 0.0003032)
    anomaly = 357.52911 + t * (35999.05029 - t * 0.0001537)
    center = (1.914602 - t * (0.004817 + t * 0.000014)) * _sin(anomaly)
    center += (0.019993 - 0.000101 * t) * _sin(2 * anomaly) + 0.000289 * _sin(3 * anomaly)
    node = 125.04452 - 1934.136261 * t
    # The pull of Venus, Jupiter and the moon (Newcomb's largest terms; Meeus, Astronomical Formulae
    # for Calculators, 4th edition, chapter 18, which counts centuries from 1900).
    c = t + 1.0
    pull = 0.00134 * _cos(153.23 + 22518.7541 * c) + 0.00154 * _cos(216.57 + 45037.5082 * c)
    pull += 0.00200 * _cos(312.69 + 32964.3577 * c) + 0.00179 * _sin(350.74 + 445267.1142 * c)
    pull += 0.00178 * _sin(231.19 + 20.20 * c)
    longitude = np.radians(mean_longitude + center + pull - 0.00569 - 0.00478 * _sin(node))
    # Chapter 22: mean obliquity, and the large terms of nutation in degrees.
    moon = 218.3165 + 481267.8813 * t
    sun = 280.4665 + 36000.7698 * t
    in_longitude = -17.20 * _sin(node) - 1.32 * _sin(2 * sun) - 0.23 * _sin(2 * moon)
    in_longitude = (in_longitude + 0.21 * _sin(2 * node)) / 3600
    in_obliquity = 9.20 * _cos(node) + 0.57 * _cos(2 * sun) + 0.10 * _cos(2 * moon)
    in_obliquity = (in_obliquity - 0.09 * _cos(2 * node)) / 3600
    mean_obliquity = 23 + 26 / 60 + (21.448 - t * (46.8150 + t * (0.00059 - t * 0.001813))) / 3600
    obliquity = np.radians(mean_obliquity + in_obliquity)
    right_ascension = np.arctan2(np.cos(obliquity) * np.sin(longitude), np.cos(longitude))
    declination = np.arcsin(np.sin(obliquity) * np.sin(longitude))
    # Chapter 12, with the day and its fraction apart, which keeps the digits.
    whole = np.floor(days)
    universal = days / 36525
    sidereal = 280.46061837 + 360 * (days - whole) + 0.98564736629 * days
    sidereal = sidereal + universal**2 * (0.000387933 - universal / 38710000)
    sidereal = sidereal + in_longitude * np.cos(obliquity)
    return right_ascension, declination, sidereal % 360


def _refraction(elevation: np.ndarray) -> np.ndarray:
    """How much the air lifts what is at a true elevation, in radians (Saemundsson, Meeus 16.4, for
    1010 hPa and 10 degrees Celsius); nothing where the sun is all below the horizon.
    """
    degrees = np.degrees(elevation)
    minutes = 1.02 / np.tan(np.radians(degrees + 10.3 / (degrees + 5.11)))
    return np.where(degrees > -0.85, np.radians(minutes / 60), 0)


def _days(when: Any) -> np.ndarray:
    """Days since J2000."""
    times = np.asarray(when)
    if times.dtype == object:
        times = np.array([_utc(time) for time in times.ravel()], "M8[us]").reshape(times.shape)
    if times.dtype.kind != "M":
        raise TypeError(f"when is {when!r}, expected a datetime, a numpy.datetime64 or an array")
    if np.isnat(times).any():
        raise ValueError("when: there is a time that is not a time (NaT)")
    days: np.ndarray = (times.astype("M8[us]") - _J2000) / np.timedelta64(1, "D")
    return days


def _utc(time: Any) -> datetime.datetime:
    if not isinstance(time, datetime.datetime):
        raise TypeError(f"when: {time!r} is not a datetime or a numpy.datetime64")
    if time.tzinfo is None:
        return time
    return time.astimezone(datetime.timezone.utc).replace(tzinfo=None)


def _degrees(value: Any, name: str, limit: float) -> np.ndarray:
    degrees = array_of(value, name)
    if degrees.dtype.kind not in "iuf":
        raise TypeError(f"{name} is {value!r}, expected degrees")
    degrees = degrees.astype(np.float64)
    if not (np.abs(degrees) <= limit).all():
        raise ValueError(f"{name} is {value!r}, expected degrees from {-limit} to {limit}")
    return degrees


def _frame(up: Any, north: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The unit vectors to the east, to the north and up."""
    turn = _upright(up)
    above = turn[:, 1]
    if north is None:
        return turn[:, 0], -turn[:, 2], above
    ahead = _upright(north, "north")[:, 1]
    level = ahead - above * (ahead @ above)
    length = np.linalg.norm(level)
    if length < 1e-6:
        raise ValueError(f"north is {north!r}, expected a direction that is not that of up, {up!r}")
    ahead = level / length
    return np.cross(ahead, above), ahead, above
