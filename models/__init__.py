"""MJCF files of the built-in scenes; every element is named."""
