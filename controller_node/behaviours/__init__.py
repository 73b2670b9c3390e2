"""Behaviours beside tracking: ragdoll, active ragdoll, reactions to hits. No ROS."""
