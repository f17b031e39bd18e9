"""The second renderer, on pyrender and OpenGL: an independent judge of the default one. See `renderer`.

Nothing here is imported unless this renderer is asked for by name.
"""
