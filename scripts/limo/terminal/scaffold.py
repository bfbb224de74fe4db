"""A new study to start from: a commented YAML file that is valid as it is."""

from __future__ import annotations

import re
from pathlib import Path

from limo.config.load import RULES, load_config
from limo.errors import ConfigError, LimoError
from limo.schema.figures import FIGURES
from limo.schema.section import ENGINES, NAME
from limo.schema.study import OUTPUTS
from limo.store.files import write_whole

TEMPLATE = """\
# {name}: every combination of the axes is a case. A line that begins with # is a comment; remove the # of a key to use it.
# All keys, units and ranges: docs/configuration.md.
description: what this study is to show
device: {device} # a file in config/devices: {devices}

axes:
  n_pouches: [4, 6] # N_p, even, 2 to 16, both faces together
  ventricular_pressure: [3.8] # P_v in kPa
  # aspect_ratio: [1.0, 2.0] # of the valve support
  # stiffness_ratio: [0.5, 1.0] # endocardial over fabric modulus
  # width_scale: [0.9, 1.0] # of the flat pattern

actuation_pressure_max: 60 # kPa; one for each P_v: {{3.8: 60, 13.8: 100}}
figures: [pressure_volume] # any of: {figures}

# preset: {preset} # mesh, numerics and engine together; of config.yaml: {presets}
# engine: {engine} # {engines}; of config.yaml when left out
# mesh: {{level: {level}, symmetry: quarter, element: C3D20R}} # levels of config.yaml: {levels}
# outputs: [volumes, contact, stress] # any of: {outputs}
# frames: [0, P_v + 10, max] # pressures in kPa whose displacements are kept
# fields_at: [max] # pressures of the fields for ParaView
# cross_check: 1 # cases that the other engine solves too
"""


def new_study(config_file: str, name: str, device: str = "limo") -> Path:
    """Write ``studies/NAME.yaml`` beside a configuration and check that it is valid; returns the file.

    Raises ``LimoError`` for a name that cannot be or is taken, and for a device that is not there; then nothing is written.
    """
    loaded = load_config(config_file)
    if not re.match(NAME, name) or name in RULES:
        raise ConfigError(
            "limo new-study", "NAME", name, "letters, digits and _, a letter first, and no rule's name", "thick_fabric"
        )
    if f"studies/{name}" in loaded.files:
        raise LimoError(f"{loaded.files[f'studies/{name}']}: there is a study of this name already")
    loaded.require_device(device, "limo new-study", "--device", "--device limo")
    config = loaded.config
    default = loaded.default()
    text = TEMPLATE.format(
        name=name,
        device=device,
        devices=", ".join(loaded.devices),
        figures=", ".join(FIGURES),
        preset=config.preset or next(iter(config.presets), "none"),
        presets=", ".join(config.presets) or "there are none",
        engine=default.engine,
        engines=" or ".join(ENGINES),
        level=default.mesh.level,
        levels=", ".join(config.mesh_levels),
        outputs=", ".join(OUTPUTS),
    )
    file = Path(config_file).parent / "studies" / f"{name}.yaml"
    write_whole(file, lambda path: path.write_text(text, encoding="utf-8"))
    try:
        load_config(config_file, [name])
    except LimoError:
        file.unlink()
        raise
    return file
