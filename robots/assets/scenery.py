"""Files of what stands around robots in pictures: data; physics needs none of them."""

from robots.assets.locator import FileLocator

PACKAGE = "maniskill_tabletop"
FOLDER = "mani_skill/utils"  # inside the wheel

TABLE = FileLocator(PACKAGE, "scene_builder/table/assets/table.glb")
GROUND_TEXTURE = FileLocator(PACKAGE, "building/assets/grid_texture.png")

FILES = (TABLE, GROUND_TEXTURE)
