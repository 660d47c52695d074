"""Physically based cloudy skies from a Stratus daemon, as numpy arrays.

>>> import stratus
>>> sky = stratus.Client().render(stratus.Scene(sun=stratus.Sun(elevation_deg=10)))
>>> sky.array.shape
(768, 1024, 3)
"""
from stratus.client import Client, limits
from stratus.errors import Busy, Denied, InvalidScene, Refused, StratusError, TimedOut, Unreachable, Wrong
from stratus.picture import Picture
from stratus.scene import Atmosphere, Camera, Clouds, Dsd, Ground, Model, Output, Radiosity, Scene, Sun

__version__ = "0.4.0"
__all__ = [
    "Atmosphere", "Busy", "Camera", "Client", "Clouds", "Denied", "Dsd", "Ground", "InvalidScene", "Model", "Output", "Picture", "Radiosity", "Refused",
    "Scene", "StratusError", "Sun", "TimedOut", "Unreachable", "Wrong", "limits",
]  # fmt: skip
