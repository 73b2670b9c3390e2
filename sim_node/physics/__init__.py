"""The simulated world without ROS: characters, contacts, passive forces, projectiles."""
