"""The engine Bullet, by PyBullet: the one place of the simulator that knows it."""
