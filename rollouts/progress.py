"""The progress of long work by the name that commands know; see `robots.common.progress`."""

from robots.common.progress import Progress as LiveLine

__all__ = ["LiveLine"]
