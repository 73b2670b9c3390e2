"""The colour of each triangle of a glTF mesh: of its material, its texture and its vertices."""

import io
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from character_motion.gltf.gamma import with_gamma, without_gamma
from character_motion.gltf.reading import GlbFile
from msgs_config.arrays import FloatArray, IntArray

_MOST_TEXELS = 2**26  # of a picture that is read, and of those that are kept before another
_CHANNELS = 3  # red, green, blue
_GREY = 0.7  # of what has no material, with sRGB's gamma


class TriangleColors:
    """Finds the colours of the meshes of one file; a picture of several of them is read once."""

    def __init__(self, file: GlbFile) -> None:
        self._file = file
        self._pictures: dict[int, NDArray[np.uint8] | None] = {}

    def colors(self, primitive: dict[str, Any], triangles: IntArray) -> FloatArray:
        """Red, green and blue (k, 3) in the middles of triangles (k, 3), 0 to 1, with sRGB's gamma.

        A texture that cannot be read is left out.
        """
        file, attributes = self._file, primitive["attributes"]
        linear = np.ones((len(triangles), 3))
        if "material" in primitive:
            material = file.entry("materials", primitive["material"])
            surface = material.get("pbrMetallicRoughness", {})
            factor = surface.get("baseColorFactor", (1.0, 1.0, 1.0, 1.0))
            linear *= np.clip(np.array(factor, dtype=np.float64)[:3], 0.0, 1.0)
            if surface.get("baseColorTexture") is not None:
                linear *= self._of_texture(surface["baseColorTexture"], attributes, triangles)
        elif "COLOR_0" not in attributes:
            return np.full((len(triangles), 3), _GREY)
        if "COLOR_0" in attributes:
            own = file.numbers(attributes, "COLOR_0", "VEC3", "VEC4")[:, :3]
            linear *= np.clip(own, 0.0, 1.0)[triangles].mean(axis=1)
        return with_gamma(linear)

    def _of_texture(
        self, texture: dict[str, Any], attributes: dict[str, Any], triangles: IntArray
    ) -> FloatArray | float:
        """The levels (k, 3) without gamma of a texture in the middles of triangles; else one."""
        transform = texture.get("extensions", {}).get("KHR_texture_transform", {})
        name = f"TEXCOORD_{transform.get('texCoord', texture.get('texCoord', 0))}"
        picture = self._picture(self._file.entry("textures", texture["index"]).get("source"))
        if picture is None or name not in attributes:
            return 1.0
        uvs = _transformed(self._file.numbers(attributes, name, "VEC2"), transform)
        return without_gamma(_sampled(picture, uvs[triangles].mean(axis=1)))

    def _picture(self, number: int | None) -> NDArray[np.uint8] | None:
        """The picture (h, w, 3) of an image; None where there is none, or it cannot be read."""
        if number is None:
            return None
        image = self._file.entry("images", number)
        if number not in self._pictures:
            kept = sum(each.size for each in self._pictures.values() if each is not None)
            if kept > _CHANNELS * _MOST_TEXELS:  # The memory for them is bounded.
                self._pictures.clear()
            self._pictures[number] = _read_picture(self._file, image)
        return self._pictures[number]


def _read_picture(file: GlbFile, image: dict[str, Any]) -> NDArray[np.uint8] | None:
    """A picture (h, w, 3); None where it cannot be read."""
    from PIL import Image

    if "bufferView" not in image:
        return None
    raw = file.view(image["bufferView"])
    try:
        with Image.open(io.BytesIO(raw)) as opened:
            if opened.width * opened.height > _MOST_TEXELS:
                return None
            return np.array(opened.convert("RGB"))
    except Exception:  # whatever a reader makes of a broken file
        return None


def _transformed(uvs: FloatArray, transform: dict[str, Any]) -> FloatArray:
    """Places (m, 2) in a texture, scaled, then turned by an angle in rad, then moved.

    https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos/KHR_texture_transform
    says counter-clockwise, which is from v to u where v is down: so other programs have it, not as
    the matrix there (https://github.com/KhronosGroup/glTF/issues/1563).
    """
    (x, y), (u, v) = transform.get("scale", (1.0, 1.0)), transform.get("offset", (0.0, 0.0))
    angle = float(transform.get("rotation", 0.0))
    c, s = math.cos(angle), math.sin(angle)
    turned: FloatArray = (uvs * (float(x), float(y))) @ np.array(((c, -s), (s, c)))
    moved: FloatArray = turned + np.array((float(u), float(v)))
    return moved


def _sampled(picture: NDArray[np.uint8], uvs: FloatArray) -> FloatArray:
    """The texels (k, 3) at places (k, 2), right and down, 0 to 1, of a picture that is repeated."""
    height, width = picture.shape[:2]
    u, v = (uvs % 1.0).T
    rows = np.minimum((v * height).astype(np.intp), height - 1)
    columns = np.minimum((u * width).astype(np.intp), width - 1)
    texels: FloatArray = picture[rows, columns] / 255.0
    return texels
