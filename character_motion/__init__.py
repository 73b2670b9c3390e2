"""Motion in and out: files of motion capture, retargeting, and edits of clips."""
