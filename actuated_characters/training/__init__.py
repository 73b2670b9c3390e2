"""Training: policies that keep a motion by joint torques alone, found by trying in many worlds."""
