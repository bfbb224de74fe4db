"""The JSON schemas of the configuration files, generated from the models (``python -m limo.config.json_schemas``)."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from limo.schema.accuracy import Airbag
from limo.schema.beat import Beat
from limo.schema.config import Config
from limo.schema.device import Device
from limo.schema.exploration import Exploration
from limo.schema.inference import Inference
from limo.schema.study import Study


def json_schemas() -> dict[str, dict[str, Any]]:
    """The JSON schemas of all kinds of configuration file, by file name."""
    models = {"config": Config, "study": Study, "device": Device, "airbag": Airbag, "inference": Inference, "beat": Beat}
    models |= {"exploration": Exploration}
    return {f"{name}.schema.json": model.model_json_schema() for name, model in models.items()}


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "workflow/schemas")
    for file_name, schema in json_schemas().items():
        (target / file_name).write_text(json.dumps(schema, indent=2) + "\n", encoding="utf-8")
