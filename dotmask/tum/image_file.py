"""Reading the PNG files of a sequence: whole and unharmed, or an error that names the file."""

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from dotmask.errors import SequenceFolderError
from dotmask.records import ColourImage, DepthImage
from dotmask.tum.camera import DEPTH_PER_METRE

PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"


def read_colour(path: Path) -> ColourImage:
    """A colour image (H, W, 3), RGB.

    Raises:
        SequenceFolderError: it cannot be read, is damaged, or has no colour of 8 bits.
    """
    bgr = _read_png(path)
    if bgr.dtype != np.uint8 or bgr.ndim != 3:
        raise SequenceFolderError(f"{path}: expected a colour image of 8 bits, found {_kind(bgr)}")
    return np.ascontiguousarray(bgr[..., 2::-1], dtype=np.uint8)


def read_depth(path: Path) -> DepthImage:
    """A depth image (H, W) in metres, 0 = no return.

    Raises:
        SequenceFolderError: it cannot be read, is damaged, or is not grey with 16 bits.
    """
    image = _read_png(path)
    if image.dtype != np.uint16 or image.ndim != 2:
        raise SequenceFolderError(f"{path}: expected a grey image of 16 bits, found {_kind(image)}")
    return np.asarray(image / DEPTH_PER_METRE, dtype=np.float32)


def _kind(image: npt.NDArray[np.uint8 | np.uint16]) -> str:
    return f"{'grey' if image.ndim == 2 else 'colour'}, {8 * image.itemsize} bits"


def _read_png(path: Path) -> npt.NDArray[np.uint8 | np.uint16]:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise SequenceFolderError(f"{path}: cannot be read ({error.strerror})") from error
    problem = png_problem(data)
    image = None if problem else cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise SequenceFolderError(f"{path}: {problem or 'cannot be decoded'}")
    return np.asarray(image)


def png_problem(data: bytes) -> str | None:
    """What is wrong with the bytes of a PNG file, None where nothing is.

    The decoder is not asked: of a file that is cut off it makes an image with a grey end. Every chunk of the format
    has a length and a checksum, and the last one is called IEND (PNG specification, section 5).
    """
    if not data.startswith(PNG_SIGNATURE):
        return "is not a PNG image"
    at = len(PNG_SIGNATURE)
    while at + 12 <= len(data):
        (length,) = struct.unpack_from(">I", data, at)
        end = at + 8 + length
        if end + 4 > len(data):
            break
        if zlib.crc32(memoryview(data)[at + 4 : end]) != struct.unpack_from(">I", data, end)[0]:
            return "is damaged: a checksum is wrong"
        if data[at + 4 : at + 8] == b"IEND":
            return None
        at = end + 4
    return "is cut off: its end is missing"
