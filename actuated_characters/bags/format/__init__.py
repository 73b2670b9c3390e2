"""The files of a bag as rosbag2 has them: MCAP, SQLite, metadata, definitions, limits."""
