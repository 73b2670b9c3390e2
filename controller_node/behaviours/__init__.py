"""What a character does when it is hit: ragdoll, active ragdoll, reaction. Pure numpy, no ROS."""
