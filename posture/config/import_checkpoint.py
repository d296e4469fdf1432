"""Configuration of the import of a checkpoint; values in conf/import_checkpoint.yaml."""

from typing import Annotated

from pydantic import BeforeValidator

from posture.config.checks import PathText
from posture.config.train import TrainConfig


def _given(file: object) -> object:
    if file is None:
        raise ValueError("name the checkpoint to import, as in file=model_1500.pt")
    return file


class ImportConfig(TrainConfig):
    """Configuration of `posture.import_checkpoint`: that of the training which the checkpoint came from, and its file."""

    file: Annotated[PathText, BeforeValidator(_given)]

    def without_effect(self) -> dict[str, str]:
        """See `CommandConfig`."""
        own = {"env", "agent", "evaluation", "seed", "file"}
        return super().without_effect() | dict.fromkeys(ImportConfig.model_fields.keys() - own, "on an import")
