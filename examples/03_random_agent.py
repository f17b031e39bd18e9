"""Drive the camera at random and print what each term of the reward comes to.

python examples/03_random_agent.py [FRAMES] [SEED]
"""

import sys

import gymnasium

import scenarios.envs

gymnasium.register_envs(scenarios.envs)  # the import has done it; this only tells that it is used

frames = int(sys.argv[1]) if len(sys.argv) > 1 else 20
seed = int(sys.argv[2]) if len(sys.argv) > 2 else 0

env = gymnasium.make("DotMask/CameraDrive-v0", scenario="smoke", overrides={"frames": frames})
env.action_space.seed(seed)
observation, info = env.reset(seed=seed)
totals: dict[str, float] = {}
steps, done = 0, False
while not done:
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
    done = terminated or truncated
    steps += 1
    for name, value in info["reward"].items():
        totals[name] = totals.get(name, 0.0) + value

print(f"{steps} steps, {'SLAM was lost' if terminated else 'the scenario is over'}")
for name, value in totals.items():
    print(f"{name:20s} {value:8.3f}")
env.close()
