"""What a render brings."""
from __future__ import annotations

import functools
import json
import os
import pathlib
import re
from dataclasses import dataclass, field

import numpy

from stratus import images
from stratus.scene import Scene

ENTRY = re.compile(r'\s*([!#$%&\'*+.^_`|~0-9A-Za-z-]+)((?:\s*;\s*[^\s=;,]+(?:\s*=\s*(?:"(?:[^"\\]|\\.)*"|[^\s;,"]*))?)*)\s*(?:,|$)')
PARAMETER = re.compile(r';\s*([^\s=;,]+)(?:\s*=\s*("(?:[^"\\]|\\.)*"|[^\s;,"]*))?')


def read_timings(header: str) -> dict[str, float]:
    """Milliseconds by stage, of a Server-Timing header (W3C)."""
    found = {}
    for name, parameters in ENTRY.findall(header or ""):
        durations = [value.strip('"') for parameter, value in PARAMETER.findall(parameters) if parameter.lower() == "dur"]
        if durations:
            found.setdefault(name, float(durations[0]))
    return found


@dataclass(frozen=True)
class Picture:
    """A file as the daemon sent it, and ways to look at it."""

    data: bytes = field(repr=False)
    content_type: str
    timings_ms: dict[str, float] = field(repr=False)
    """How long each stage took in the daemon."""
    seconds: float
    """From asking to the last byte."""
    etag: str = ""

    @property
    def is_exr(self) -> bool:
        return self.data.startswith(images.EXR)

    @functools.cached_property
    def array(self) -> numpy.ndarray:
        """[height][width][3]: uint8 or uint16 (sRGB) of a PNG; float32, linear, of an EXR's color."""
        return self.layers["color"]

    @functools.cached_property
    def layers(self) -> dict[str, numpy.ndarray]:
        """All layers of an EXR; of a PNG its color."""
        return images.read_exr(self.data) if self.is_exr else {"color": images.read_png(self.data)}

    @property
    def scene(self) -> Scene:
        """The whole scene that the file carries: rendered again it is this picture."""
        text = images.exr_text(self.data, "stratus:scene") if self.is_exr else images.png_text(self.data, "stratus:scene")
        return Scene.from_json(json.loads(text or "{}"))

    def save(self, path: str | os.PathLike) -> pathlib.Path:
        """Whole or not at all."""
        path = pathlib.Path(path)
        part = path.with_name(path.name + f".{os.getpid()}.part")
        try:
            part.write_bytes(self.data)
            os.replace(part, path)
        finally:
            part.unlink(missing_ok=True)
        return path

    def __array__(self, dtype=None, copy=None):
        return self.array.astype(dtype, copy=False) if dtype is not None else self.array

    def _repr_mimebundle_(self, **_):
        """How a notebook shows it."""
        return {} if self.is_exr else {"image/png": self.data}
