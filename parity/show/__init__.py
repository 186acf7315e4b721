"""Pictures and clips of native and ours side by side."""
