"""Files of what stands around robots in pictures: data; physics needs none of them."""

from robots.assets.locator import FileLocator

PACKAGE = "maniskill_tabletop"
MANI_SKILL_FOLDER = "utils"  # inside mani_skill

TABLE = FileLocator(PACKAGE, "scene_builder/table/assets/table.glb")
GROUND_TEXTURE = FileLocator(PACKAGE, "building/assets/grid_texture.png")

FILES = (TABLE, GROUND_TEXTURE)
