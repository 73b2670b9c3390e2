"""The exercises, one a module: `TITLE` and `grade(student, sheet)`."""
