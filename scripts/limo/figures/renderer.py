"""Whether this machine can render surfaces, asked without loading what renders them."""

from __future__ import annotations

import ctypes
import os

#: what a window without a display needs of the system, as Debian and Ubuntu call it
RENDERER_PACKAGES = "libegl1 libgl1-mesa-dri"


def renderer_lacks() -> str:
    """Why the figures in ``SHAPES`` cannot be drawn on this machine and what to install, or nothing."""
    if os.environ.get("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow") == "vtkEGLRenderWindow":
        try:
            ctypes.CDLL("libEGL.so.1")
        except OSError as error:
            return f"surfaces cannot be rendered ({error}): install the system's packages {RENDERER_PACKAGES}"
    return ""
