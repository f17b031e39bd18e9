"""Bake the people: anny body model -> dressed, skinned, textured characters in `assets/humans`.

The steps, in the order of the data: `body` (shape, skeleton, skin weights, relaxed hands), `clothes` (garments cut
from the body model's auxiliary surface), `head` (skin, eyes), `hair` (locks that grow and fall), `cloth_paint` and
`skin_paint` (colours as functions of a point in space), `store` (one npz per character, manifest).
"""
