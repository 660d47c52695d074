"""Pictures of the daemon as numpy arrays.

PNG needs nothing but zlib: the daemon writes RGB of 8 or 16 bits whose rows are filtered by Sub, which numpy undoes at once. EXR is read by
OpenImageIO, which is not small and therefore optional (pip install stratus-client[exr], or Debian's python3-openimageio).
"""
from __future__ import annotations

import os
import struct
import tempfile
import zlib

import numpy

PNG = b"\x89PNG\r\n\x1a\n"
EXR = b"\x76\x2f\x31\x01"


def chunks(data: bytes):
    at = len(PNG)
    while at + 12 <= len(data):
        size, name = struct.unpack(">I4s", data[at : at + 8])
        yield name, data[at + 8 : at + 8 + size]
        at += 12 + size


def unfilter(rows: numpy.ndarray, pixel_bytes: int) -> numpy.ndarray:
    """Rows of bytes, each behind the number of its filter."""
    kinds, data = rows[:, 0], rows[:, 1:].reshape(len(rows), -1, pixel_bytes).copy()
    if kinds.max(initial=0) > 2:
        raise ValueError("a PNG that is not the daemon's: read it with another library")
    sub = kinds == 1
    data[sub] = numpy.cumsum(data[sub], axis=1, dtype=numpy.uint8)
    for row in numpy.flatnonzero(kinds == 2):
        if row > 0:
            data[row] += data[row - 1]
    return data


def read_png(data: bytes) -> numpy.ndarray:
    """[height][width][3] of uint8 or uint16, as the file has them (sRGB)."""
    packed, header = b"", None
    for name, body in chunks(data):
        if name == b"IHDR":
            header = struct.unpack(">IIBBBBB", body)
        elif name == b"IDAT":
            packed += body
    if not header or header[3] != 2 or header[2] not in (8, 16) or header[6] != 0:
        raise ValueError("a PNG that is not the daemon's: read it with another library")
    width, height, bits = header[:3]
    rows = numpy.frombuffer(zlib.decompress(packed), numpy.uint8).reshape(height, 1 + width * 3 * bits // 8)
    pixels = unfilter(rows, 3 * bits // 8)
    if bits == 16:
        pixels = pixels.view(">u2").astype(numpy.uint16)
    return pixels.reshape(height, width, 3)


def png_text(data: bytes, keyword: str) -> str | None:
    """Of an uncompressed iTXt, such as stratus:scene."""
    for name, body in chunks(data):
        found, _, rest = body.partition(b"\0")
        if name == b"iTXt" and found == keyword.encode() and rest[:1] == b"\0":
            return rest[2:].split(b"\0", 2)[2].decode()
    return None


def open_exr(data: bytes):
    """OpenImageIO's reader; the file is deleted when the reader is closed."""
    try:
        import OpenImageIO
    except ImportError as missing:
        raise ImportError("EXR is read by OpenImageIO: pip install stratus-client[exr], or apt-get install python3-openimageio") from missing
    with tempfile.NamedTemporaryFile(suffix=".exr", delete=False) as file:
        file.write(data)
    try:
        reader = OpenImageIO.ImageInput.open(file.name)
        if not reader:
            raise ValueError(f"no EXR: {OpenImageIO.geterror()}")
        return reader, OpenImageIO.FLOAT
    finally:
        os.unlink(file.name)


def read_exr(data: bytes) -> dict[str, numpy.ndarray]:
    """float32 by layers: color [height][width][3], distance [height][width], ... in 1000 cd/m2 of white where it is light."""
    reader, kind = open_exr(data)
    names = list(reader.spec().channelnames)
    pixels = numpy.asarray(reader.read_image(kind), numpy.float32)
    reader.close()
    layers: dict[str, list[int]] = {}
    for index, name in enumerate(names):
        layers.setdefault(name.rpartition(".")[0] or "color", []).append(index)
    return {layer: pixels[..., indices] if len(indices) > 1 else pixels[..., indices[0]] for layer, indices in layers.items()}


def exr_text(data: bytes, attribute: str) -> str | None:
    reader, _ = open_exr(data)
    text = reader.spec().getattribute(attribute)
    reader.close()
    return text
