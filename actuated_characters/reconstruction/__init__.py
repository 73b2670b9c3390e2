"""Captured motion with joint torques alone: sampling-based motion control, planning its samples."""
