"""The kinds of numbers that a glTF 2.0 file has, by the names and codes that it gives them.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html#accessor-data-types
"""

WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
"""How many numbers a row of an accessor has, by its type."""

COMPONENTS: dict[int, str] = {
    5120: "|i1",
    5121: "|u1",
    5122: "<i2",
    5123: "<u2",
    5125: "<u4",
    5126: "<f4",
}
"""How each of them is stored, by its component type, as NumPy calls it."""
