"""Files that users add by name: listed, checked, described by schemas."""
