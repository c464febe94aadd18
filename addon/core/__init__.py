"""The pipeline on NumPy and the native kernel: never imports bpy, importable and testable alone."""
