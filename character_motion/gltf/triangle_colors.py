"""The colour of each triangle of a glTF mesh: of its material, its texture and its vertices."""

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from character_motion.gltf.gamma import with_gamma, without_gamma
from character_motion.gltf.reading import GlbFile
from msgs_config.arrays import FloatArray, IntArray

_MOST_TEXELS = 2**26
_GREY = 0.7  # of what has no material, with sRGB's gamma


def triangle_colors(file: GlbFile, primitive: dict[str, Any], triangles: IntArray) -> FloatArray:
    """Red, green and blue (k, 3) in the middles of triangles (k, 3), 0 to 1, with sRGB's gamma.

    A texture that cannot be read is left out.
    """
    attributes = primitive["attributes"]
    linear = np.ones((len(triangles), 3))
    if "material" in primitive:
        material = file.entry("materials", primitive["material"])
        surface = material.get("pbrMetallicRoughness", {})
        factor = surface.get("baseColorFactor", (1.0, 1.0, 1.0, 1.0))
        linear *= np.clip(np.array(factor, dtype=np.float64)[:3], 0.0, 1.0)
        texture = surface.get("baseColorTexture")
        if texture is not None:
            uvs = f"TEXCOORD_{texture.get('texCoord', 0)}"
            picture = _picture(file, texture["index"])
            if uvs in attributes and picture is not None:
                middles = file.numbers(attributes, uvs, "VEC2")[triangles].mean(axis=1)
                linear *= without_gamma(_sampled(picture, middles))
    elif "COLOR_0" not in attributes:
        return np.full((len(triangles), 3), _GREY)
    if "COLOR_0" in attributes:
        own = file.numbers(attributes, "COLOR_0", "VEC3", "VEC4")[:, :3]
        linear *= np.clip(own, 0.0, 1.0)[triangles].mean(axis=1)
    return with_gamma(linear)


def _picture(file: GlbFile, number: int) -> NDArray[np.uint8] | None:
    """A texture's picture (h, w, 3); None where it cannot be read."""
    from PIL import Image

    image = file.entries("images")[file.entries("textures")[number].get("source", -1)]
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


def _sampled(picture: NDArray[np.uint8], uvs: FloatArray) -> FloatArray:
    """The texels (k, 3) at places (k, 2), right and down, 0 to 1, of a picture that is repeated."""
    height, width = picture.shape[:2]
    u, v = (uvs % 1.0).T
    rows = np.minimum((v * height).astype(np.intp), height - 1)
    columns = np.minimum((u * width).astype(np.intp), width - 1)
    texels: FloatArray = picture[rows, columns] / 255.0
    return texels
