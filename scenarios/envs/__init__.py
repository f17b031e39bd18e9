"""Gymnasium environments: drive the camera, or be the masking front end. Importing this package registers them.

    import gymnasium
    import scenarios.envs

    env = gymnasium.make("DotMask/CameraDrive-v0", scenario="smoke")

`gymnasium.make("scenarios.envs:DotMask/CameraDrive-v0")` does both at once. See docs/gym.md.
"""

import gymnasium

ENTRY_POINTS = {
    "DotMask/CameraDrive-v0": "scenarios.envs.camera_drive:CameraDrive",
    "DotMask/Masking-v0": "scenarios.envs.masking:Masking",
}
"""The environments by id; their modules are loaded when one is made."""

for _id, _entry_point in ENTRY_POINTS.items():
    gymnasium.register(id=_id, entry_point=_entry_point)
