"""How things move: rigid bodies, simulated once with Bullet and then replayed from keyframes."""
