"""YOLACT (Bolya et al., ICCV 2019) and YOLACT++ (TPAMI 2020), one file a part, and a small network of the same design.

Written from the papers and from the names and shapes of the tensors in the authors' checkpoints. Boxes are shares of
the image's width and height: `x1, y1, x2, y2`, or centre and size where a name says so.
"""
