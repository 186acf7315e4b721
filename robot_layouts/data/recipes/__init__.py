"""Data sets as recipes: files that say how recordings and exports are made again."""
