"""The graphics driver's device: a process that draws has one, and a fork of it has none.

SAPIEN tells its name only; which driver it has, Vulkan itself is asked.
"""

from __future__ import annotations

import ctypes
import os
from ctypes import POINTER, Structure, byref, c_char, c_char_p, c_uint8, c_uint32, c_void_p
from functools import cache
from typing import Any, NamedTuple
from weakref import WeakSet

from robot_layouts.core.operating_system import after_fork
from robots import SimulationError

# What Mesa's software driver goes by: bits that it computes at once, threads, instructions.
_VARIABLES = ("LP_NATIVE_VECTOR_WIDTH", "LP_NUM_THREADS", "GALLIUM_OVERRIDE_CPU_CAPS")

_VULKAN = "libvulkan.so.1"
_VERSION_1_2 = 1 << 22 | 2 << 12
# Vulkan's numbers of these structures
_APPLICATION, _INSTANCE, _PROPERTIES, _DRIVER = 0, 1, 1000059001, 1000196000
_PROCESSOR = 4  # its number of that kind of device
_LIMITS = 4096  # bytes, more than the limits take that stand behind a device's name

_owner: int | None = None  # the process that drew first, here or in what this is a fork of
_worlds: WeakSet[Any] = WeakSet()


def expect_render_device() -> None:
    """Note that this process draws, before it does.

    Raises:
        SimulationError: If it is a fork of one that did: there it would wait for ever.
    """
    global _owner
    if _owner is None:
        _owner = os.getpid()
    elif _owner != os.getpid():
        raise SimulationError(
            f"no pictures can be drawn here: process {_owner}, of which this one is a fork, drew"
            " some, and graphics drivers do not survive a fork; use spawn in the place of fork"
            ' (multiprocessing.get_context("spawn"), or context="spawn")'
        )


def outlive_forks(world: Any) -> None:
    """Let a world that draws never be freed in a fork: its driver would wait for ever there."""
    _worlds.add(world)


def _keep_worlds() -> None:
    for world in _worlds:
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(world))  # not even when Python ends


after_fork(_keep_worlds)


# -- what draws ----------------------------------------------------------------------------------


class _VulkanProgram(Structure):
    _fields_ = (
        ("type", c_uint32),
        ("next", c_void_p),
        ("name", c_char_p),
        ("version", c_uint32),
        ("engine", c_char_p),
        ("engine_version", c_uint32),
        ("api_version", c_uint32),
    )


class _VulkanInstance(Structure):
    _fields_ = (
        ("type", c_uint32),
        ("next", c_void_p),
        ("flags", c_uint32),
        ("application", POINTER(_VulkanProgram)),
        ("layer_count", c_uint32),
        ("layers", c_void_p),
        ("extension_count", c_uint32),
        ("extensions", c_void_p),
    )


class _VulkanDriver(Structure):
    _fields_ = (
        ("type", c_uint32),
        ("next", c_void_p),
        ("id", c_uint32),
        ("name", c_char * 256),
        ("info", c_char * 256),
        ("conformance", c_uint8 * 4),
    )


class _VulkanDevice(Structure):
    _fields_ = (
        ("type", c_uint32),
        ("next", c_void_p),
        ("api_version", c_uint32),
        ("driver_version", c_uint32),
        ("vendor", c_uint32),
        ("device", c_uint32),
        ("kind", c_uint32),
        ("name", c_char * 256),
        ("limits", c_uint8 * _LIMITS),
    )


def describe_graphics(device: str) -> dict[str, str]:
    """Return what pixels depend on besides the scene, as plain data.

    Args:
        device: The name of the device that draws.

    Returns:
        ``device``, ``driver`` (name and version, ``unknown`` if Vulkan does not tell), ``threads``
        that a software driver has, and the ``variables`` that it goes by.
    """
    device, driver = _named(device)
    return {
        "device": device,
        "driver": driver.name if driver else "unknown",
        "threads": os.environ.get("LP_NUM_THREADS") or str(os.cpu_count()),
        "variables": " ".join(f"{n}={os.environ[n]}" for n in _VARIABLES if n in os.environ),
    }


def draws_in_software(device: str) -> bool:
    """Tell whether a device, by its name, is the processor; one that Vulkan does not tell of is."""
    _, driver = _named(device)
    return driver is None or driver.software


class _Driver(NamedTuple):
    name: str
    software: bool


def _named(device: str) -> tuple[str, _Driver | None]:
    """Return the name that Vulkan has for a device, and its driver."""
    drivers = _drivers()
    if device not in drivers and len(drivers) == 1:
        (device,) = drivers  # SAPIEN calls it "cpu" where native ManiSkill chose it
    return device, drivers.get(device)


@cache
def _drivers() -> dict[str, _Driver]:
    """Return the driver of each device by the device's name."""
    try:
        vulkan = ctypes.CDLL(_VULKAN)
        about_devices = vulkan.vkGetPhysicalDeviceProperties2
    except (OSError, AttributeError):
        return {}
    application = _VulkanProgram(type=_APPLICATION, api_version=_VERSION_1_2)
    asked = _VulkanInstance(type=_INSTANCE, application=ctypes.pointer(application))
    instance, count = c_void_p(), c_uint32()
    if vulkan.vkCreateInstance(byref(asked), None, byref(instance)):
        return {}
    try:
        vulkan.vkEnumeratePhysicalDevices(instance, byref(count), None)
        devices = (c_void_p * count.value)()
        vulkan.vkEnumeratePhysicalDevices(instance, byref(count), devices)
        found: dict[str, _Driver] = {}
        for device in devices:
            driver = _VulkanDriver(type=_DRIVER)
            about = _VulkanDevice(type=_PROPERTIES, next=ctypes.cast(byref(driver), c_void_p))
            about_devices(c_void_p(device), byref(about))
            told = driver.info.decode(errors="replace") or f"{about.driver_version:#x}"
            name = driver.name.decode(errors="replace")
            software = about.kind == _PROCESSOR
            found[about.name.decode(errors="replace")] = _Driver(f"{name}, {told}", software)
        return found
    finally:
        vulkan.vkDestroyInstance(instance, None)
