"""Recordings: rosbag2 directories, written and read."""
