"""Things made by code from parameters and a seed: meshes, textures, furniture."""
